// Errors by kind, so that the page can choose its words.

/**
 * A scene that was refused; `kind` is one of `not-l4gs`, `newer`, `too-large`, `damaged`, `memory`,
 * `network`, `cameras` (their JSON is none), `blocked` (the page or the browser lets no decoder start), `closed`, `fault`.
 */
export class SceneError extends Error {
  /** @param {string} kind @param {string} message */
  constructor(kind, message) {
    super(message);
    this.name = "SceneError";
    this.kind = kind;
  }
}

/** A browser, or a graphics driver, that cannot draw this. */
export class GraphicsError extends Error {
  /** @param {string} message */
  constructor(message) {
    super(message);
    this.name = "GraphicsError";
  }
}
