declare module "virtual:decoder" {
  /** The WebAssembly module, gzip, as base64. */
  const base64: string;
  export default base64;
}
declare module "virtual:worker" {
  /** The worker's source. */
  const source: string;
  export default source;
}
declare module "virtual:style" {
  /** The style sheet of the element. */
  const css: string;
  export default css;
}
declare module "virtual:sample" {
  /** A small scene, as base64. */
  const base64: string;
  export default base64;
}
