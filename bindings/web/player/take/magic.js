// How a take is told from a scene.

const MAGIC = [0x89, 0x4c, 0x34, 0x47, 0x54, 0x0d, 0x0a, 0x1a];
/** Bytes from the beginning that tell it. */
export const MAGIC_BYTES = MAGIC.length;

/** @param {Uint8Array} bytes  the first ones of a file */
export const isTake = (bytes) => MAGIC.every((byte, at) => bytes[at] === byte);
