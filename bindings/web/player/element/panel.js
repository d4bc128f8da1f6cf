// The panel: facts about the scene, and the times of a frame.

/** @typedef {import("../player.js").Player} Player */

const number = new Intl.NumberFormat("en");
/** @param {number} bytes */
const size = (bytes) => (bytes < 1e3 ? `${bytes} B` : bytes < 1e6 ? `${number.format(Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(2)} MB`);
/** @param {number} value */
const ms = (value) => `${value.toFixed(value < 10 ? 1 : 0)} ms`;

/** @param {Player} player */
function whileMoving({ draftScale, draftLevel }) {
  const shares = draftScale < 1 ? [`${Math.round(100 * draftScale)} % of each side`] : [];
  if (draftLevel > 0) shares.push(`1/${2 ** draftLevel} of the Gaussians`);
  return shares.join(", ") || "in full";
}

/** @param {[string, string][]} rows */
function body(rows) {
  const part = document.createElement("tbody");
  for (const [label, value] of rows) {
    const row = part.insertRow();
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = label;
    row.append(head);
    row.insertCell().textContent = value;
  }
  return part;
}

/**
 * @param {HTMLElement} panel
 * @param {Player} player
 */
export function fillPanel(panel, player) {
  const { info, decodeMs } = player.scene;
  const heading = document.createElement("h2");
  heading.textContent = info.name || "A scene without a name";
  const table = document.createElement("table");
  const { evaluate, sort, upload, draw } = player.timings;
  table.append(
    body([
      ["File", size(info.bytes)],
      ["Gaussians", number.format(player.scene.count)],
      ["Harmonics", `degree ${info.shDegree}`],
      ["Frames", info.fps > 0 ? `${info.frameCount} at ${info.fps} a second` : String(info.frameCount)],
      ["Image", `${player.view.width} × ${player.view.height}`],
      ["While moving", whileMoving(player)],
    ]),
    body(info.sections.map(([name, bytes]) => [name.replaceAll("_", " "), size(bytes)])),
    body([
      ["Images per second", player.fps > 0 ? player.fps.toFixed(0) : "–"],
      ["Decoding", ms(decodeMs)],
      ["Motion, worker", ms(evaluate)],
      ["Order and colors, worker", ms(sort)],
      ["Upload", ms(upload)],
      ["Draw calls", ms(draw)],
    ]),
  );
  panel.replaceChildren(heading, table);
}
