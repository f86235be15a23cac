import assert from "node:assert/strict";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { load } from "./load.mjs";

const { Packed } = load("shared/packed.js");
const packed = (value) => gzipSync(JSON.stringify(value)).toString("base64");

test("packed data are read, with any character", async () => {
  const value = { text: "</script> ⟨1⟩ 🚗", numbers: [0.1, null, 3] };
  assert.deepEqual(await Packed.unpack(`\n${packed(value)}\n`), value);
});

test("damaged data are an error", async () => {
  const text = packed([1, 2, 3]);
  await assert.rejects(Packed.unpack(text.slice(0, -8)));
});

test("an element is unpacked once, and an absent one is null", async () => {
  const ids = [];
  globalThis.document = { getElementById: (id) => (ids.push(id), id === "here" ? { textContent: packed([1]) } : null) };
  assert.equal(Packed.read("here"), Packed.read("here"));
  assert.deepEqual([await Packed.read("here"), await Packed.read("absent")], [[1], null]);
  assert.deepEqual(ids, ["here", "absent"]);
});
