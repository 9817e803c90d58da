// Compares WebAssembly with native code: node bunny.mjs MODULE NATIVE_PROGRAM MESH.ply
// Prints the least time of both for a build and for coherent rays, and their ratio.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

// Vertices that begin with x, y, z and faces of three, in ASCII or little-endian.
function readPly(path) {
    const bytes = readFileSync(path);
    const end = bytes.indexOf("end_header\n") + "end_header\n".length;
    const head = bytes.toString("latin1", 0, end).split("\n");
    const count = (name) => Number(head.find((line) => line.startsWith(`element ${name} `)).split(" ")[2]);
    const first = head.findIndex((line) => line.startsWith("element vertex"));
    const last = head.findIndex((line) => line.startsWith("element face"));
    const stride = head.slice(first + 1, last).filter((line) => line.startsWith("property")).length;
    const positions = new Float32Array(3 * count("vertex"));
    const indices = new Uint32Array(3 * count("face"));
    if (head.includes("format ascii 1.0")) {
        const words = bytes.toString("latin1", end).split(/\s+/).map(Number);
        for (let i = 0; i < positions.length; i++)
            positions[i] = words[Math.floor(i / 3) * stride + (i % 3)];
        const from = (positions.length / 3) * stride;
        for (let i = 0; i < indices.length; i++)
            indices[i] = words[from + Math.floor(i / 3) * 4 + 1 + (i % 3)];
    } else {
        let at = end;
        for (let i = 0; i < positions.length; i += 3, at += 4 * stride)
            for (let axis = 0; axis < 3; axis++) positions[i + axis] = bytes.readFloatLE(at + 4 * axis);
        for (let i = 0; i < indices.length; i += 3, at += 13)
            for (let corner = 0; corner < 3; corner++) indices[i + corner] = bytes.readUInt32LE(at + 1 + 4 * corner);
    }
    return { positions, indices };
}

const [modulePath, native, plyPath] = process.argv.slice(2);
const { positions, indices } = readPly(plyPath);

const folder = mkdtempSync(join(tmpdir(), "bunny-"));
const raw = join(folder, "mesh");
writeFileSync(raw, Buffer.concat([
    Buffer.from(Uint32Array.of(positions.length / 3, indices.length / 3).buffer),
    Buffer.from(positions.buffer), Buffer.from(indices.buffer)]));
const [nativeBuild, nativeTrace, nativeSum] = execFileSync(native, [raw]).toString().split(" ").map(Number);
rmSync(folder, { recursive: true });

const { instance } = await WebAssembly.instantiate(readFileSync(modulePath), {});
const web = instance.exports;
new Float32Array(web.memory.buffer, web.vertices(), positions.length).set(positions);
new Uint32Array(web.memory.buffer, web.triangles(), indices.length).set(indices);
if (web.prepare(positions.length / 3, indices.length / 3) !== 0) throw new Error("the mesh is too large");
// The least of many times: the first calls run code of the quick compiler.
function least(call) {
    let best = Infinity;
    for (let i = 0; i < 30; i++) {
        const start = performance.now();
        if (call() !== 0) throw new Error("a call failed");
        best = Math.min(best, performance.now() - start);
    }
    return best;
}
const build = least(web.build);
const trace = least(web.trace);
const show = (name, here, there) =>
    console.log(`${name}: native ${there.toFixed(2)} ms, WebAssembly ${here.toFixed(2)} ms, ${(here / there).toFixed(2)} times`);
show("build", build, nativeBuild);
show("coherent rays", trace, nativeTrace);
if (web.sum() >>> 0 !== nativeSum) throw new Error("other hits than natively");
