// The index of a take, range by range. The decoder says which ranges those are.

/**
 * @param {import("../scene/connection.js").Connection} connection
 * @param {import("./take.js").RangedFile} file
 * @returns {Promise<{ index: import("./take.js").Index, ranges: Uint8Array[] } | null>}  and the ranges, for another decoder; null where it is the
 *   index of another file than before
 * @throws {import("../errors.js").SceneError}
 */
export async function readIndex(connection, file) {
  /** @type {Uint8Array[]} */
  const ranges = [];
  for (;;) {
    const { needed, index } = await connection.ask({ type: "index", ranges, length: lengthOf(file) });
    if (!needed) return index && { index, ranges };
    ranges.push(await file.read(needed[0], needed[1]));
  }
}

/** Bytes of a file; where they are not known, a segment that is cut short is refused when it is read. @param {{ length: number }} file */
export const lengthOf = ({ length }) => (length > 0 ? length : Number.MAX_SAFE_INTEGER);
