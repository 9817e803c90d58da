// Runs the sums for WebAssembly and prints their lines: node node.mjs MODULE
// Or prints a page that does the same in a browser:      node node.mjs --page MODULE
import { readFileSync } from "node:fs";

async function run(bytes, print) {
    let memory;
    const text = (at) => {
        const all = new Uint8Array(memory.buffer);
        return String.fromCharCode(...all.subarray(at, all.indexOf(0, at)));
    };
    const hex = (half) => (half >>> 0).toString(16).padStart(8, "0");
    const line = (mesh, method, what, high, low) =>
        print(`${text(mesh)} ${text(method)} ${text(what)} ${hex(high)}${hex(low)}`);
    const { instance } = await WebAssembly.instantiate(bytes, { env: { line } });
    memory = instance.exports.memory;
    return instance.exports.run();
}

const isPage = process.argv[2] === "--page";
const bytes = readFileSync(process.argv[isPage ? 3 : 2]);
if (isPage) {
    console.log(`<!doctype html><pre></pre><script>${run}
const bytes = Uint8Array.from(atob("${bytes.toString("base64")}"), (c) => c.charCodeAt(0));
const pre = document.querySelector("pre");
run(bytes, (line) => { pre.textContent += line + "\\n"; })
    .then((failure) => { pre.textContent += failure ? "step " + failure + " failed\\n" : ""; });
</script>`);
} else {
    const failure = await run(bytes, (line) => console.log(line));
    if (failure) console.error(`step ${failure} failed`);
    process.exit(failure ? 1 : 0);
}
