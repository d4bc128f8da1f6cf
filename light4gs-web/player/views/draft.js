// How much of the image's resolution there is time for while something moves.

/** Shares of the pixels along each side. */
const SCALES = [1, 0.7, 0.5, 0.35];
/** Milliseconds of an image: above, the next smaller scale; below, a larger one is tried after a while. */
const [SLOW, FAST] = [28, 14];
/** Images that are measured before a scale is judged. */
const SAMPLES = 4;
/** Milliseconds until a larger scale is tried. */
const PATIENCE = 4000;

/** Chooses the scale from the time that images take. What stands still is always drawn in full. */
export class Draft {
  #step = 0;
  /** @type {number[]} */
  #intervals = [];
  #tried = 0;

  /** The scale to draw moving images at. */
  get scale() {
    return SCALES[this.#step];
  }

  /**
   * A moving image took so long.
   * @param {number} interval  milliseconds
   * @param {number} now
   */
  measure(interval, now) {
    // Whoever looked elsewhere for a while says nothing about the machine.
    if (interval > 5000) return;
    this.#intervals.push(interval);
    const hopeless = this.#intervals.length > 1 && Math.min(...this.#intervals) > 3 * SLOW;
    if (this.#intervals.length < SAMPLES && !hopeless) return;
    const sorted = this.#intervals.sort((a, b) => a - b);
    const median = sorted[Math.floor(sorted.length / 2)];
    this.#intervals = [];
    if (median > SLOW && this.#step < SCALES.length - 1) {
      // Far too slow: more than one step at once.
      this.#step = Math.min(this.#step + (median > 3 * SLOW ? 2 : 1), SCALES.length - 1);
      this.#tried = now;
    } else if (median < FAST && this.#step > 0 && now - this.#tried > PATIENCE) {
      this.#step--;
      this.#tried = now + 5 * PATIENCE;
    }
  }
}
