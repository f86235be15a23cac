import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { load } from "./load.mjs";

const { ReplayClock } = load("replay/data.js", "replay/clock.js");

let frames, isCalm;
globalThis.requestAnimationFrame = (frame) => frames.push(frame);
globalThis.matchMedia = () => ({ get matches() { return isCalm; } });

beforeEach(() => {
  frames = [];
  isCalm = false;
});

/** Run the frames that are due at `now` ms. */
function frame(now) {
  for (const due of frames.splice(0)) due(now);
}

function clockAt(at, more = {}) {
  const drawn = [];
  const clock = new ReplayClock({ start: 0, end: 4, stops: [], steps: [0, 1, 2, 3, 4], at, ...more }, ({ t }) => drawn.push(t));
  return { clock, drawn };
}

test("the time stays between start and end", () => {
  const { clock } = clockAt(1);
  clock.seek(9);
  assert.equal(clock.t, 4);
  clock.seek(-9);
  assert.equal(clock.t, 0);
});

test("several changes before a frame are drawn once", () => {
  const { clock, drawn } = clockAt(1);
  clock.seek(2);
  clock.seek(3);
  frame(0);
  assert.deepEqual(drawn, [3]);
  assert.equal(frames.length, 0);
});

test("a step goes to the next sample, also from between two samples", () => {
  for (const [from, by, to] of [[1, 1, 2], [1, -1, 0], [1.5, 1, 2], [1.5, -1, 1], [0, -1, 0], [4, 1, 4]]) {
    const { clock } = clockAt(from);
    clock.step(by);
    assert.equal(clock.t, to, `${by} from ${from}`);
  }
});

test("playing follows the clock of the browser at the chosen speed", () => {
  const { clock } = clockAt(1);
  clock.speed = 2;
  clock.play();
  frame(1000);
  assert.equal(clock.t, 1);
  frame(1250);
  assert.equal(clock.t, 1.5);
});

test("after a long time without frames, the replay goes on where it was", () => {
  const { clock } = clockAt(1);
  clock.play();
  frame(1000);
  frame(61_000);
  assert.equal(clock.t, 1 + ReplayClock.CALM / 1000);
});

test("playing pauses exactly at a stop and goes on from it", () => {
  const { clock } = clockAt(1, { stops: [1.2] });
  clock.play();
  frame(0);
  frame(400);
  assert.equal(clock.t, 1.2);
  assert.equal(clock.isPlaying, false);
  assert.equal(frames.length, 0);
  clock.play();
  frame(1000);
  frame(1100);
  assert.ok(clock.t > 1.2);
});

test("playing ends at the end and starts again from the start", () => {
  const { clock } = clockAt(3.9);
  clock.play();
  frame(0);
  frame(400);
  assert.deepEqual([clock.t, clock.isPlaying], [4, false]);
  clock.toggle();
  assert.deepEqual([clock.t, clock.isPlaying], [0, true]);
});

test("a paused clock requests no more frames when it is paused again", () => {
  const { clock } = clockAt(1);
  clock.pause();
  assert.equal(frames.length, 0);
});

test("with reduced motion, a replay advances twice a second without frames in between", (context) => {
  context.mock.timers.enable({ apis: ["setInterval"] });
  isCalm = true;
  let now = 0;
  context.mock.method(performance, "now", () => now);
  const { clock, drawn } = clockAt(1);
  clock.play();
  frame(0);
  assert.equal(frames.length, 0);
  for (now = ReplayClock.CALM; now <= 2 * ReplayClock.CALM; now += ReplayClock.CALM) {
    context.mock.timers.tick(ReplayClock.CALM);
    frame(now);
  }
  assert.deepEqual(drawn, [1, 1.5, 2]);
});
