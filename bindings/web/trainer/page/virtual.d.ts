declare module "virtual:trainer-worker" {
  /** The worker's source. */
  const source: string;
  export default source;
}
