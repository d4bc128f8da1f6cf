// Layers over the canvas while there is nothing to see on it: one at a time.

import { explain } from "./messages.js";

const LAYERS = ["progress", "message", "invitation"];

/** The layers of one element. */
export class Layers {
  /** @param {(id: string) => any} find */
  constructor(find) {
    this.find = find;
  }

  /** Shows one of them, or none. @param {"progress" | "message" | "invitation" | ""} id */
  show(id) {
    for (const layer of LAYERS) this.find(layer).hidden = layer !== id;
  }

  /** @param {string} what @param {number} [share]  in [0, 1]; NaN where it is not known */
  progress(what, share = NaN) {
    this.show("progress");
    const progress = this.find("progress");
    const bar = progress.querySelector("div");
    if (Number.isNaN(share)) bar.removeAttribute("aria-valuenow");
    else bar.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    bar.firstElementChild.style.width = Number.isNaN(share) ? "" : `${100 * share}%`;
    progress.querySelector("span").textContent = Number.isNaN(share) ? `${what} …` : `${what} ${Math.round(100 * share)} %`;
  }

  /**
   * Says what is wrong.
   * @param {unknown} error
   * @param {(() => void) | null} chooseAnother  what a button does that offers to choose another file
   */
  message(error, chooseAnother) {
    const { title, advice, details } = explain(error);
    const paragraph = (/** @type {string} */ tag, /** @type {string} */ text) => Object.assign(document.createElement(tag), { textContent: text });
    const more = document.createElement("details");
    more.append(paragraph("summary", "Details"), paragraph("p", details));
    const message = this.find("message");
    message.replaceChildren(paragraph("b", title), paragraph("p", advice), more);
    if (chooseAnother) {
      const again = Object.assign(document.createElement("button"), { type: "button", id: "choose", textContent: "Choose another file" });
      again.addEventListener("click", chooseAnother);
      message.append(again);
    }
    this.show("message");
  }
}
