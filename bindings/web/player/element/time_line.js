// What the time line shows of a take: the parts that have come.

/**
 * Shades parts of the time line.
 * @param {HTMLInputElement} input
 * @param {[number, number][]} parts  first and last second of each
 * @param {number} duration  seconds
 */
export function shade(input, parts, duration) {
  const at = (/** @type {number} */ seconds) => `${((100 * seconds) / duration).toFixed(2)}%`;
  const stops = parts.flatMap(([begin, end]) => [`transparent ${at(begin)}`, `var(--accent) ${at(begin)} ${at(end)}`, `transparent ${at(end)}`]);
  input.style.backgroundImage = stops.length > 0 ? `linear-gradient(to right, ${stops.join(", ")})` : "";
}
