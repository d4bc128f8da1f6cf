// A curve of PSNR over iterations, as SVG.

const WIDTH = 480;
const HEIGHT = 120;

export class Curve {
  /** @type {[number, number][]} */
  #points = [];

  /** @param {SVGElement} svg */
  constructor(svg) {
    this.svg = svg;
    svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    this.clear();
  }

  clear() {
    this.#points = [];
    this.svg.replaceChildren();
  }

  /** @param {number} iteration @param {number} psnr  dB */
  add(iteration, psnr) {
    this.#points.push([iteration, psnr]);
    const values = this.#points.map(([, value]) => value);
    const [least, most] = [Math.min(...values), Math.max(...values)];
    const last = this.#points[this.#points.length - 1][0];
    const line = this.#points.map(([x, y]) => {
      const height = most > least ? (y - least) / (most - least) : 0.5;
      return `${((WIDTH * x) / last).toFixed(1)},${(HEIGHT - 4 - (HEIGHT - 8) * height).toFixed(1)}`;
    });
    this.svg.innerHTML = `<polyline fill="none" stroke="currentColor" stroke-width="2" points="${line.join(" ")}"/>`;
    this.svg.setAttribute("aria-label", `PSNR of training views: from ${least.toFixed(1)} to ${most.toFixed(1)} dB in ${last} iterations`);
  }
}
