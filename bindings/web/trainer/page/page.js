// The page that trains a scene in a worker, and shows its messages.

import workerSource from "virtual:trainer-worker";
import { Curve } from "./curve.js";

/** @typedef {import("./worker.js").Message} Message */
/** @typedef {import("../../player/element/element.js").L4gsPlayer} L4gsPlayer */

/** @param {string} id @returns {any} */
const find = (id) => document.getElementById(id);
const curve = new Curve(find("curve"));
/** @type {Worker | null} */
let worker = null;
/** Compiled once. @type {Promise<WebAssembly.Module> | null} */
let compiled = null;

/** @param {string} text */
const say = (text) => (find("status").textContent = text);

/** @param {number} bytes */
const kilobytes = (bytes) => `${Math.round(bytes / 1000)} kB`;

/** A folder's files, with their paths inside of it. @param {FileList} list */
async function filesOf(list) {
  return Promise.all(
    [...list].map(async (file) => ({ path: `dataset/${file.webkitRelativePath.split("/").slice(1).join("/")}`, bytes: await file.arrayBuffer() })),
  );
}

/** The trainer, from the address that the page names. */
async function trainer() {
  const address = document.body.dataset.trainer ?? "";
  const response = await fetch(address);
  if (!response.ok) throw new Error(`${address}: HTTP ${response.status} ${response.statusText}`);
  return WebAssembly.compile(await response.arrayBuffer());
}

async function start() {
  end();
  const folder = find("folder").files;
  const settings = find("settings").value.split("\n").map((/** @type {string} */ line) => line.trim()).filter(Boolean);
  curve.clear();
  find("warnings").replaceChildren();
  find("results").hidden = true;
  find("train").hidden = true;
  find("stop").hidden = false;
  say("Loading the trainer …");
  const source = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
  const mine = new Worker(source);
  URL.revokeObjectURL(source);
  worker = mine;
  mine.onmessage = ({ data }) => mine === worker && take(data);
  mine.onerror = (event) => mine === worker && take({ kind: "error", text: event.message });
  try {
    compiled ??= trainer();
    const files = find("own").checked ? await filesOf(folder) : [];
    if (find("own").checked && files.length === 0) throw new Error("choose the folder of a dataset first");
    const module = await compiled;
    if (mine !== worker) return;
    say(find("own").checked ? "Reading the dataset …" : "Making the scene …");
    mine.postMessage({ module, files, settings }, files.map(({ bytes }) => bytes));
  } catch (error) {
    compiled = null;
    if (mine === worker) take({ kind: "error", text: error instanceof Error ? error.message : String(error) });
  }
}

/** Ends the training, if there is one. */
function end() {
  worker?.terminate();
  worker = null;
  find("train").hidden = false;
  find("stop").hidden = true;
}

/** @param {Uint8Array} bytes @param {string} type */
const address = (bytes, type) => URL.createObjectURL(new Blob([/** @type {BlobPart} */ (bytes)], { type }));

/** Sets an address that holds bytes, and frees the one before. @param {any} element @param {"src" | "href"} field @param {string} value */
function replace(element, field, value) {
  if (element[field]?.startsWith("blob:")) URL.revokeObjectURL(element[field]);
  element[field] = value;
}

/** @param {Uint8Array | undefined} bytes */
function show(bytes) {
  const player = /** @type {L4gsPlayer} */ (find("player"));
  // The scene before is closed only by `keep`.
  if (bytes) player.open(bytes, { keep: player.player !== null });
}

/** @param {Message} message */
function take(message) {
  const { kind, contents = {} } = message;
  if (kind === "stage") {
    find("bar").max = message.iterations;
    find("bar").value = 0;
    say(`${message.stage} stage`);
  } else if (kind === "log") {
    find("bar").value = message.iteration;
    if (message.psnr !== undefined && message.stage === "fine") curve.add(message.iteration, message.psnr);
    const psnr = message.psnr === undefined ? "" : `, ${message.psnr.toFixed(2)} dB`;
    say(`${message.stage} stage, iteration ${message.iteration} of ${find("bar").max}, ${message.gaussians} Gaussians${psnr}, ${Math.round(message.seconds)} s`);
  } else if (kind === "picture") {
    if (contents.file) replace(find("picture"), "src", address(contents.file, "image/png"));
  } else if (kind === "scene") {
    show(contents.file);
  } else if (kind === "fit") {
    find("bar").max = message.iterations;
    find("bar").value = message.done;
    say(`fitting entropy models, ${message.done} of ${message.iterations}`);
  } else if (kind === "warning") {
    find("warnings").append(Object.assign(document.createElement("li"), { textContent: message.text }));
  } else if (kind === "done") {
    end();
    show(contents.file);
    replace(find("download"), "href", address(/** @type {Uint8Array} */ (contents.file), "application/octet-stream"));
    replace(find("report"), "href", address(/** @type {Uint8Array} */ (contents.report), "text/html"));
    find("bar").value = find("bar").max;
    find("results").hidden = false;
    const psnr = message.psnr === null ? "" : `${message.psnr.toFixed(2)} dB on the test views, `;
    say(`Done: ${psnr}${kilobytes(message.bytes)}, trained for ${(message.seconds / 60).toFixed(1)} minutes`);
  } else if (kind === "error") {
    end();
    say(`Failed: ${message.text}`);
  }
}

find("wishes").addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
find("train").addEventListener("click", start);
find("stop").addEventListener("click", () => {
  end();
  say("Stopped");
});
find("folder").addEventListener("change", () => (find("own").checked = true));
