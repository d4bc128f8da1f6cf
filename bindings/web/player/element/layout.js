// The parts of the element.

import style from "virtual:style";

/** Shapes on a field of 24 by 24. @type {Record<string, string>} */
const ICONS = {
  play: "M8 5v14l11-7z",
  pause: "M7 5h4v14H7zM13 5h4v14h-4z",
  loop: "M7 7h9V4l5 4.5L16 13v-3H9v3H6V8a1 1 0 0 1 1-1zm10 10H8v3l-5-4.5L8 11v3h7v-3h3v5a1 1 0 0 1-1 1z",
  fly: "M12 2l4 7h-3v5h5v-3l4 4-4 4v-3H6v3l-4-4 4-4v3h5V9H8z",
  reset: "M12 4a8 8 0 1 1-7.4 5H7a6 6 0 1 0 5-3v3L7.500 5 12 1z",
  info: "M11 10h2v7h-2zM11 6.500h2v2h-2zM12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20zm0 18a8 8 0 1 1 0-16 8 8 0 0 1 0 16z",
  full: "M4 9V4h5v2H6v3zM15 4h5v5h-2V6h-3zM4 15h2v3h3v2H4zM18 15h2v5h-5v-2h3z",
  open: "M4 5h6l2 2h8v12H4zm2 4v8h12V9z",
};

/** @param {string} name */
export const icon = (name) => `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`;

/** @param {string} id @param {string} label @param {string} key  the key that does the same */
const button = (id, label, key) =>
  `<button type="button" id="${id}" aria-label="${label}" title="${label} (${key})">${icon(id)}</button>`;

export const LAYOUT = `<style>${style}</style>
<div id="frame">
<div id="stage">
  <canvas tabindex="0" role="img" aria-describedby="keys"></canvas>
  <p id="keys" class="spoken">Arrow keys turn the view, plus and minus zoom, W A S D Q E move, Z and X roll, shift and arrows pan,
  space plays, comma and period step, R resets.</p>
  <div id="progress" hidden><div role="progressbar" aria-label="Loading" aria-valuemin="0" aria-valuemax="100"><i></i></div><span></span></div>
  <div id="message" role="alert" hidden></div>
  <div id="invitation" hidden>
    <p><b>Drop a .l4gs scene here</b></p>
    <button type="button" id="choose">Choose a file</button>
  </div>
  <section id="panel" aria-label="About this scene" hidden></section>
  <p id="status" role="status" hidden></p>
</div>
<div id="bar" role="group" aria-label="Playback" hidden>
  ${button("play", "Play", "space")}
  <span id="line"><input id="time" type="range" min="0" max="1" step="0.001" value="0" aria-label="Time"><i id="parts"></i></span>
  <output id="clock" for="time"></output>
  <select id="speed" aria-label="Speed" title="Speed">
    <option value="0.1">0.1×</option><option value="0.25">0.25×</option><option value="0.5">0.5×</option>
    <option value="1" selected>1×</option><option value="2">2×</option><option value="4">4×</option>
  </select>
  ${button("loop", "Loop", "L")}
  <span id="cameras"><select id="camera" aria-label="Camera" title="Cameras of the dataset (C)"></select></span>
  ${button("fly", "Look around in place of turning the scene", "V")}
  ${button("reset", "Reset the view", "R")}
  <input id="background" type="color" aria-label="Background color" title="Background color">
  ${button("info", "About this scene", "I")}
  ${button("open", "Open a file", "O")}
  ${button("full", "Full screen", "F")}
</div>
</div>
<input id="file" type="file" accept=".l4gs,application/octet-stream" hidden aria-label="Scene file">`;
