import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const MODES = { "(prefers-color-scheme: dark)": { matches: false }, print: { matches: false } };
globalThis.matchMedia = (query) => MODES[query];
globalThis.document = { documentElement: {} };
globalThis.getComputedStyle = () => {
  const shade = MODES.print.matches ? "paper" : "screen";
  return { getPropertyValue: (name) => (name === "--replay-ink" ? "" : ` ${shade} ${name} `) };
};
const { ReplayColours } = load("replay/colours.js");

test("a colour of the replay's own replaces the page's", () => {
  const { golden, ink } = ReplayColours.now();
  assert.deepEqual([golden, ink], ["screen --replay-golden", "screen --ink"]);
});

test("the colours are the same object until the mode of the page changes", () => {
  const before = ReplayColours.now();
  assert.equal(ReplayColours.now(), before);
  MODES.print.matches = true;
  assert.equal(ReplayColours.now().golden, "paper --replay-golden");
  MODES.print.matches = false;
  assert.equal(ReplayColours.now(), before);
});

test("a canvas has the resolution of the screen", () => {
  globalThis.devicePixelRatio = 1.5;
  const transforms = [];
  const canvas = { style: {}, getContext: () => ({ setTransform: (...numbers) => transforms.push(numbers) }) };
  ReplayColours.fitted(canvas, 101, 20);
  assert.deepEqual([canvas.width, canvas.height, canvas.style.width], [152, 30, "101px"]);
  assert.deepEqual(transforms, [[1.5, 0, 0, 1.5, 0, 0]]);
});
