// What the time line shows of a take: the parts that have come.

/**
 * Shades parts of the time line.
 * @param {HTMLElement} element  as long as the line
 * @param {[number, number][]} parts  first and last second of each, one after the other
 * @param {number} duration  seconds
 */
export function shade(element, parts, duration) {
  const at = (/** @type {number} */ seconds) => `${((100 * seconds) / duration).toFixed(2)}%`;
  /** Neighbors are one part: a take has many segments. @type {[number, number][]} */
  const joined = [];
  for (const [begin, end] of parts) {
    const last = joined[joined.length - 1];
    if (last && last[1] === begin) last[1] = end;
    else joined.push([begin, end]);
  }
  const stops = joined.flatMap(([begin, end]) => [`transparent ${at(begin)}`, `var(--accent) ${at(begin)} ${at(end)}`, `transparent ${at(end)}`]);
  element.style.backgroundImage = stops.length > 0 ? `linear-gradient(to right, ${stops.join(", ")})` : "";
}
