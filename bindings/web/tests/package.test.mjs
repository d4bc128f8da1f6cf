// The package for npm, as a stranger gets it: packed, installed into an empty folder, imported by node, checked by TypeScript.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, describe, test } from "node:test";
import { root } from "./harness.mjs";

const source = `${root}/bindings/web`;
const compiler = `${source}/node_modules/.bin/tsc`;
const engines = `${source}/examples/node_modules`;
const manifest = JSON.parse(readFileSync(`${source}/package.json`, "utf8"));

/** What a user of the library may write. */
const USER = `
import { Follower, Player, SceneError, baseColors, dismiss, load, prepare, type GaussiansAt, type Scene } from "light4gs-player";

prepare();
const scene: Scene = await load(new Uint8Array(8)).catch((error: SceneError) => { throw new Error(error.kind); });
const gaussians: GaussiansAt = await scene.gaussiansAt(0.5);
const [x, color]: [number, Float32Array] = [gaussians.means[0], baseColors(gaussians)];
const follower = new Follower((time: number) => scene.gaussiansAt(time), ({ count }, time) => console.log(count, time.toFixed(2)));
await follower.update(0.25);
const shown: number | null = follower.shown;
const player = new Player(document.createElement("canvas"), scene, { autoplay: true, loop: false });
player.addEventListener("timechange", () => console.log(player.time, x, color, shown, scene.info.bounds[1][2]));
// @ts-expect-error: a time is a number
scene.gaussiansAt("now");
dismiss();
`;

/** The same with the four engines. */
const ENGINES = `
import type { Scene } from "light4gs-player";
import { createSplats as inBabylon } from "light4gs-player/babylon";
import { createSplats as inPlayCanvas } from "light4gs-player/playcanvas";
import { createSplats as inSpark } from "light4gs-player/spark";
import { createSplats as inThree } from "light4gs-player/three";
import type { Scene as World } from "@babylonjs/core/scene.js";
import type { AppBase } from "playcanvas";
import { PerspectiveCamera, Scene as Objects } from "three";

export async function show(scene: Scene, world: World, app: AppBase): Promise<number> {
  const [objects, camera] = [new Objects(), new PerspectiveCamera()];
  const three = await inThree(scene, camera);
  const spark = await inSpark(scene);
  objects.add(three.object, spark.object);
  const babylon = await inBabylon(scene, world, 0);
  babylon.object.position.x = 1;
  const playcanvas = await inPlayCanvas(scene, app);
  app.root.addChild(playcanvas.object);
  await three.update(0.5, camera);
  for (const splats of [spark, babylon, playcanvas]) await splats.update(0.5);
  playcanvas.dispose();
  // @ts-expect-error: three.js needs a camera
  await inThree(scene);
  return three.time + spark.time;
}
`;

describe("the package", () => {
  const folder = mkdtempSync(`${tmpdir()}/light4gs-package-`);
  const installed = `${folder}/node_modules/light4gs-player`;
  const run = (command, ...options) => execFileSync(command, options, { cwd: folder, encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });

  before(() => {
    execFileSync("npm", ["pack", "--silent", "--pack-destination", folder], { cwd: source, stdio: ["ignore", "ignore", "inherit"] });
    writeFileSync(`${folder}/package.json`, '{ "private": true, "type": "module" }');
    const [archive] = readdirSync(folder).filter((name) => name.endsWith(".tgz"));
    run("npm", "install", "--offline", "--no-audit", "--no-fund", `./${archive}`);
  });

  after(() => rmSync(folder, { recursive: true, force: true }));

  /** Compiles a program that uses the package, as strictly as can be. */
  const check = (name, text, ...options) => {
    writeFileSync(`${folder}/${name}`, text);
    const strict = ["--noEmit", "--strict", "--target", "es2022", "--lib", "es2023,dom,dom.iterable", "--types", ""];
    try {
      run(compiler, ...strict, ...options, name);
    } catch (error) {
      assert.fail(error.stdout);
    }
  };

  test("has what it names, both licenses and where it comes from, and nothing else", () => {
    for (const entry of Object.values(manifest.exports)) {
      for (const file of typeof entry === "string" ? [entry] : Object.values(entry)) assert.ok(existsSync(`${installed}/${file}`), file);
    }
    for (const name of ["LICENSE-MIT", "LICENSE-APACHE"]) {
      assert.equal(readFileSync(`${installed}/${name}`, "utf8"), readFileSync(`${root}/${name}`, "utf8"));
    }
    assert.match(readFileSync(`${installed}/dist/made-with.txt`, "utf8"), /^rustc .*\nesbuild .*\nzlib /);
    assert.deepEqual(readdirSync(installed).sort(), ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "dist", "examples", "package.json"]);
    assert.deepEqual(readdirSync(`${folder}/node_modules`).filter((name) => !name.startsWith(".")), ["light4gs-player"]);
    assert.ok(!existsSync(`${source}/LICENSE-MIT`), "npm pack leaves its copies behind");
  });

  test("is imported by node, where there is no DOM", () => {
    const names = run("node", "--input-type=module", "--eval", 'console.log(Object.keys(await import("light4gs-player")).sort().join())');
    assert.equal(names.trim(), "Camera,Follower,GraphicsError,L4gsPlayer,Player,Scene,SceneError,SplatRenderer,Take,baseColors,dismiss,load,prepare");
  });

  for (const resolution of ["bundler", "nodenext"]) {
    test(`has types (${resolution})`, () => {
      check("user.ts", USER, "--module", resolution === "bundler" ? "esnext" : "nodenext", "--moduleResolution", resolution);
    });
  }

  test("has types of the four adapters", { skip: !existsSync(engines) && "npm ci in bindings/web/examples has not been run" }, () => {
    for (const name of ["three", "@types", "@babylonjs", "playcanvas", "@sparkjsdev"]) symlinkSync(`${engines}/${name}`, `${folder}/node_modules/${name}`);
    // The engines' own types are not ours to check.
    check("engines.ts", ENGINES, "--module", "esnext", "--moduleResolution", "bundler", "--skipLibCheck");
  });
});
