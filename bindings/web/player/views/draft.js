// Resolution of the image, and level of detail of the Gaussians, that there is time for while something moves.

/**
 * Shares of the pixels along each side, and levels of detail, each faster than the one before. Of the pairs that take the same
 * time, these look best (docs/player.md).
 */
const LADDER = [[1, 0], [0.7, 0], [0.7, 1], [0.5, 1], [0.5, 2], [0.35, 2], [0.35, 3], [0.35, 4], [0.35, 5]];
/** Milliseconds of an image: above, the next faster step; below, a slower one is tried after a while. */
const [SLOW, FAST] = [28, 14];
/** Replaces the first number where the next step would look worse than fewer images per second. */
const VERY_SLOW = 45;
/** The last step of the ladder that looks well. */
const LAST_GOOD = LADDER.findIndex(([, level]) => level > 2) - 1;
/** Images that are measured before a step is judged. */
const SAMPLES = 4;
/** Milliseconds until a slower step is tried. */
const PATIENCE = 4000;

/** Chooses a step from the time that images take. */
class Steps {
  step = 0;
  /** Milliseconds that an image took the last time this was judged, the median. */
  median = Infinity;
  /** @type {number[]} */
  #intervals = [];
  #tried = 0;

  /**
   * @param {number} last  the fastest step
   * @param {number} [lastGood]  the fastest one that is worth it where not much time is missing
   */
  constructor(last, lastGood = last) {
    this.last = last;
    this.lastGood = lastGood;
  }

  /**
   * Records that an image took `interval`.
   * @param {number} interval  milliseconds
   * @param {number} now
   * @returns {number} by how many steps that changed the step
   */
  measure(interval, now) {
    // After a pause, such as in another tab, an interval says nothing about the machine.
    if (interval > 5000) return 0;
    this.#intervals.push(interval);
    const hopeless = this.#intervals.length > 1 && Math.min(...this.#intervals) > 3 * SLOW;
    if (this.#intervals.length < SAMPLES && !hopeless) return 0;
    const sorted = this.#intervals.sort((a, b) => a - b);
    const median = sorted[Math.floor(sorted.length / 2)];
    this.median = median;
    const before = this.step;
    this.#intervals = [];
    if (median > (this.step < this.lastGood ? SLOW : VERY_SLOW) && this.step < this.last) {
      // Far too slow: more than one step at once.
      const steps = median > 6 * SLOW ? 4 : median > 3 * SLOW ? 2 : 1;
      this.step = Math.min(this.step + steps, this.last);
      this.#tried = now;
    } else if (median < FAST && this.step > 0 && now - this.#tried > PATIENCE) {
      this.step--;
      this.#tried = now + 5 * PATIENCE;
    }
    // Images of another step take another time.
    if (this.step !== before) this.median = Infinity;
    return this.step - before;
  }
}

/** Chooses scale and level from the time that images take. A still image is always drawn in full. */
export class Draft {
  #drawing = new Steps(LADDER.length - 1, LAST_GOOD);
  #worker;

  /** @param {number} levels  of detail that the scene has besides itself */
  constructor(levels) {
    this.levels = levels;
    // Each level takes half of the time of the one before.
    this.#worker = new Steps(levels, 2);
  }

  /** The scale to draw moving images at: the share of the pixels along each side. */
  get scale() {
    return LADDER[this.#drawing.step][0];
  }

  /** The level of detail of moving images, for which both drawing and worker have time. */
  get level() {
    return Math.min(this.levels, Math.max(LADDER[this.#drawing.step][1], this.#worker.step));
  }

  /** Whether there is time for two pictures of all pixels and all Gaussians in place of one. */
  get hasTimeForTwo() {
    return this.scale === 1 && this.level === 0 && 2 * this.#drawing.median < SLOW;
  }

  /**
   * Records that drawing a moving image took `interval`.
   * @param {number} interval  milliseconds
   * @param {number} now
   */
  measureDrawing(interval, now) {
    const { scale, level } = this;
    const steps = this.#drawing;
    const change = Math.sign(steps.measure(interval, now));
    // Steps without effect are skipped: the scene has no such level, or the worker needs a higher one anyway.
    while (change !== 0 && scale === this.scale && level === this.level && LADDER[steps.step + change]) steps.step += change;
  }

  /**
   * Records that the list of a moving image took the worker `interval`.
   * @param {number} interval  milliseconds
   * @param {number} now
   */
  measureWorker(interval, now) {
    this.#worker.measure(interval, now);
  }
}
