// Messages to the user about errors: a sentence, a remedy, and the details for a report.

/** @type {Record<string, [string, string]>} */
const SCENE_MESSAGES = {
  "not-l4gs": ["This is not a .l4gs scene.", "Choose a file that Light4GS wrote."],
  newer: ["This scene was made by a newer Light4GS.", "Use a newer player to see it."],
  damaged: ["This file is damaged or incomplete.", "Download or copy it again."],
  "too-large": ["This scene is larger than the player accepts.", "Files from strangers may ask for any amount of memory, so there is a limit."],
  memory: ["There is not enough memory for this scene.", "Close other pages, or open it on a larger machine."],
  network: ["The scene cannot be loaded.", "Check the address and the connection."],
  cameras: ["The cameras of this scene cannot be read.", "They are a JSON list, as docs/player.md says."],
  blocked: [
    "The decoder cannot start in this page.",
    "The browser may be too old for it. A content security policy needs script-src 'wasm-unsafe-eval' and worker-src blob:.",
  ],
  fault: ["The player failed.", "This is our fault: please report it with the details below."],
};

/**
 * @param {any} error
 * @returns {{ title: string, advice: string, details: string }}
 */
export function explain(error) {
  const details = error instanceof Error ? error.message : String(error);
  if (error?.name === "GraphicsError") {
    return {
      title: "This browser cannot draw the scene.",
      advice: "It takes WebGL2: use a current Chrome, Edge, Firefox or Safari, and switch hardware acceleration on.",
      details,
    };
  }
  const [title, advice] = SCENE_MESSAGES[error?.kind] ?? SCENE_MESSAGES.fault;
  return { title, advice, details };
}
