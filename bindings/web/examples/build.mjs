// Makes a folder that any server can serve: a page about the library with a running scene, and the four examples.
// usage: node build.mjs [FOLDER]     build/ where none is given

import { build } from "esbuild";
import { copyFileSync, mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { fileURLToPath } from "node:url";

export const ENGINES = ["three", "spark", "babylon", "playcanvas"];
const here = fileURLToPath(new URL(".", import.meta.url));

/**
 * @param {string} folder
 * @param {string} [player]  another bundle of the library than that of `dist`
 */
export async function buildExamples(folder, player = `${here}/../dist/light4gs-player.js`) {
  mkdirSync(folder, { recursive: true });
  copyFileSync(`${here}/index.html`, `${folder}/index.html`);
  copyFileSync(`${here}/../tests/data/quickstart.l4gs`, `${folder}/scene.l4gs`);
  copyFileSync(player, `${folder}/light4gs-player.js`);
  await build({
    absWorkingDir: here,
    entryPoints: ENGINES.map((engine) => ({ in: `${engine}/main.js`, out: `${engine}/main` })),
    outdir: folder,
    bundle: true,
    // One copy of the library for the four. Modules that an engine loads only when needed stay in files of their own.
    splitting: true,
    format: "esm",
    target: "es2022",
    logLevel: "error",
    alias: { "light4gs-player": player },
  });
  for (const engine of ENGINES) copyFileSync(`${here}/${engine}/index.html`, `${folder}/${engine}/index.html`);
}

if (process.argv[1] === fileURLToPath(import.meta.url)) await buildExamples(resolve(process.argv[2] ?? `${here}/build`));
