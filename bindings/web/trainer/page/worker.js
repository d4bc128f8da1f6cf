// Runs the trainer, a program for WASI, with a file system in memory. A page sends one `Start` and gets one `Message` after another.

import { ConsoleStdout, Directory, File, OpenFile, PreopenDirectory, WASI, WASIProcExit } from "@bjorn3/browser_wasi_shim";

/**
 * @typedef {object} Start
 * @property {WebAssembly.Module} module
 * @property {{ path: string, bytes: ArrayBuffer }[]} files  of the dataset; none for the synthetic scene
 * @property {string[]} settings  keys of the configuration, each as `KEY=VALUE`
 */
/** @typedef {Map<string, File | Directory>} Contents */
/** @typedef {Record<string, any> & { kind: string, contents?: Record<string, Uint8Array> }} Message  as trainer/src/main.rs says, with the files that it names */

/** Fields of messages that name files. */
const FILES = ["file", "report"];

/** @param {Message} message */
const post = (message) => self.postMessage(message);

/**
 * Folders and files from paths.
 * @param {Start["files"]} files
 */
function tree(files) {
  /** @type {Contents} */
  const root = new Map();
  for (const { path, bytes } of files) {
    const names = path.split("/");
    const last = /** @type {string} */ (names.pop());
    let folder = root;
    for (const name of names) {
      let inner = folder.get(name);
      if (!(inner instanceof Directory)) folder.set(name, (inner = new Directory(new Map())));
      folder = /** @type {Contents} */ (inner.contents);
    }
    folder.set(last, new File(bytes));
  }
  return root;
}

/**
 * The bytes of a file, if there is one.
 * @param {Contents} root @param {string} path
 */
function read(root, path) {
  /** @type {File | Directory | undefined} */
  let entry = new Directory(root);
  for (const name of path.split("/").filter(Boolean)) {
    entry = entry instanceof Directory ? /** @type {File | Directory | undefined} */ (entry.contents.get(name)) : undefined;
  }
  return entry instanceof File ? entry.data : undefined;
}

/** @param {MessageEvent<Start>} event */
self.onmessage = async ({ data: { module, files, settings } }) => {
  const root = tree(files);
  /** Text of the program besides messages, such as the reason of a panic. @type {string[]} */
  const said = [];
  const fds = [
    new OpenFile(new File([])),
    ConsoleStdout.lineBuffered((line) => {
      const message = JSON.parse(line);
      const named = FILES.filter((field) => message[field]).map((field) => [field, read(root, message[field])]);
      post({ ...message, contents: Object.fromEntries(named) });
    }),
    ConsoleStdout.lineBuffered((line) => said.push(line)),
    new PreopenDirectory("/", root),
  ];
  const wasi = new WASI(["light4gs-web-trainer", "dataset", "run", ...settings], [], fds);
  try {
    const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi.wasiImport });
    wasi.start(/** @type {any} */ (instance));
  } catch (error) {
    // The program has told why it ends with an error.
    if (!(error instanceof WASIProcExit)) post({ kind: "error", text: [error, ...said].join("\n") });
  }
};
