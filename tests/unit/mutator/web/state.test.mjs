import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { load } from "./load.mjs";

const { State } = load("report/rows.js", "report/state.js");

let written;
globalThis.addEventListener = () => {};
globalThis.location = { hash: "" };
for (const how of ["pushState", "replaceState"]) {
  globalThis.history = { ...globalThis.history, [how]: (_, __, to) => {
    written.push([how, to]);
    globalThis.location.hash = to;
  } };
}

beforeEach(() => (written = []));

function stateOf(fragment) {
  globalThis.location.hash = `#${fragment}`;
  return new State(() => {});
}

test("a fragment is read and written without loss", () => {
  for (const fragment of ["", "e=aaaa11", "q=two%20words", "kind=sensor%2Fshifted&scenario=S1,S2&sort=-t_hazard&heat=silent&cols=kind,delta_v"]) {
    assert.equal(stateOf(fragment).fragment(), fragment);
  }
});

test("values with separators survive", () => {
  const state = stateOf("");
  state.choose({ kind: ["a,b&c=d"] });
  assert.deepEqual(stateOf(written[0][1].slice(1)).chosen.get("kind"), new Set(["a,b&c=d"]));
});

test("a fragment that was cut is read as far as possible", () => {
  const state = stateOf("q=word&kind=%E2%82");
  assert.deepEqual([state.query, state.chosen.size], ["word", 0]);
});

test("filters that the page does not have are reported", () => {
  assert.deepEqual(stateOf("colour=red&q=x").unknown, ["colour"]);
});

test("none in a fragment means the empty cell", () => {
  assert.deepEqual(stateOf("hazards=none").chosen.get("hazards"), new Set(["no hazard"]));
});

test("the link of a section is not a state", () => {
  assert.equal(State.isOurs("tables"), false);
  assert.equal(stateOf("tables").isFiltered, false);
});

test("toggling a value twice restores the state, with a step for Back each time", () => {
  const state = stateOf("");
  state.toggle("kind", "stuck");
  assert.ok(state.isFiltered);
  state.toggle("kind", "stuck");
  assert.equal(state.isFiltered, false);
  assert.deepEqual(written, [["pushState", "#kind=stuck"], ["pushState", "#"]]);
});

test("a change that Back must skip replaces the step, and no change adds none", () => {
  const state = stateOf("");
  state.set({ query: "x" }, { replace: true });
  state.set({ query: "x" });
  assert.deepEqual(written, [["replaceState", "#q=x"]]);
});
