// tests/browser/test_formulas.py compares thousands of values with Python.
import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { Formula } = load("replay/formula.js");
const VALUES = { t: [0, 0.5, 1], gap: [4, 2, 6] };
const evaluate = (tree) => Formula.evaluate(tree, VALUES);

test("numbers, names and operators are evaluated at each step", () => {
  assert.deepEqual(evaluate(2), [2, 2, 2]);
  assert.deepEqual(evaluate("inf"), [Infinity, Infinity, Infinity]);
  assert.deepEqual(evaluate(["/", ["-", "gap", 1], 2]), [1.5, 0.5, 2.5]);
  assert.deepEqual(evaluate(["if", ["<", "gap", 3], 1, ["min", "gap", 5]]), [4, 1, 5]);
});

test("a condition that has held once stays true under ever", () => {
  assert.deepEqual(evaluate(["ever", ["<", "gap", 3]]), [false, true, true]);
});

test("a rate is per second and has no value in the first step", () => {
  assert.deepEqual(evaluate(["rate", "gap"]), [NaN, -4, 8]);
});

test("an absent channel is an error that names it", () => {
  assert.throws(() => evaluate(["abs", "speed"]), /no channel speed/);
});
