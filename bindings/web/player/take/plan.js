// Which segments a time needs.

/**
 * @typedef {object} Place  a segment of the index
 * @property {number} begin  the first second of the take at which it is shown; it tells the segment from all others
 * @property {number} end  the second at which it is not shown any more
 * @property {number} first  where its bytes begin in the file
 * @property {number} last  where they end
 */

/** Seconds ahead whose segments are loaded. */
const SECONDS_AHEAD = 5;
/** Segments that are loaded ahead at most, where they are short. */
const MOST_AHEAD = 16;
/** Segments that are decoded ahead. */
const DECODED_AHEAD = 2;
/**
 * Seconds after a join in which only the next segment is decoded, and not those behind it: on few cores images would be late, and there is
 * time for it later. A quarter of the segment, where that is less.
 */
const CALM = 0.5;
/** Segments that are decoded at most: besides those ahead, the one that is shown and one behind. */
export const MOST_DECODED = DECODED_AHEAD + 2;

/**
 * The number of the last segment that begins by a time; -1 where none has begun.
 * @param {Place[]} places  in the order of their begins
 * @param {number} seconds
 */
function lastBegun(places, seconds) {
  let [low, high] = [0, places.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (places[middle].begin <= seconds) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/**
 * The segment of a time; none in a gap.
 * @param {Place[]} places
 * @param {number} seconds
 * @returns {Place | undefined}
 */
export function placeAt(places, seconds) {
  const place = places[lastBegun(places, seconds)];
  return place && seconds < place.end ? place : undefined;
}

/**
 * @param {Place[]} places  in the order of their begins
 * @param {number} seconds
 * @param {{ held?: Place, loop: boolean, duration: number }} options  `held` is on the screen until the segment of the time is there
 * @returns {{ shown: Place | undefined, load: Place[], decode: Place[], keep: Place[] }}  in the order in which they are needed: those whose
 *   bytes are loaded, those that are decoded now, and those that may stay decoded, at most {@link MOST_DECODED}
 */
export function plan(places, seconds, { held, loop, duration }) {
  const shown = placeAt(places, seconds);
  const at = lastBegun(places, seconds);
  const ahead = [];
  for (let k = 1; k <= MOST_AHEAD && k < places.length + (shown ? 0 : 1); k++) {
    const number = at + k;
    if (number >= places.length && !loop) break;
    const place = places[number % places.length];
    const begin = place.begin + (number >= places.length ? duration : 0);
    // One is loaded in any case: after a long gap as well there must be no pause.
    if (k > 1 && begin > seconds + SECONDS_AHEAD) break;
    ahead.push(place);
  }
  const load = shown ? [shown, ...ahead] : ahead;
  const near = load.slice(0, (shown ? 1 : 0) + DECODED_AHEAD);
  const calm = shown && seconds - shown.begin < Math.min(CALM, (shown.end - shown.begin) / 4);
  const behind = held && held !== shown ? held : places[shown ? at - 1 : at];
  const keep = behind && !near.includes(behind) ? [...near, behind] : near;
  return { shown, load, decode: calm ? near.slice(0, 2) : near, keep };
}
