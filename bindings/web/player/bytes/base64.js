// Bytes that stand in a text.

/**
 * @param {string} text  base64
 * @returns {Uint8Array<ArrayBuffer>}
 * @throws {DOMException} where it is none
 */
export function fromBase64(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  // A loop: Uint8Array.from with a function takes ten times as long, before the first image.
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return bytes;
}
