// The decoder of the bundle, in this process.

import { readFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";

const bundle = readFileSync(new URL("../dist/light4gs-player.js", import.meta.url), "utf8");
// The only long text in the bundle that begins like gzip.
const [packed] = bundle.match(/H4sI[A-Za-z0-9+/]{10000,}=*/);

/** For instances of `Decoder`. */
export const decoderModule = new WebAssembly.Module(gunzipSync(Buffer.from(packed, "base64")));
