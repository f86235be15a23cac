// @ts-check
"use strict";
// Evaluates a manifest's formulas and conditions over the steps of a run, as triggers/trace_formulas.py does. The input
// is trees (triggers/formula_json.py): numbers, names, and lists of an operator and its operands.

const Formula = (() => {
  const OF_NUMBERS = {
    "+": (a, b) => a + b, "-": (a, b) => a - b, "*": (a, b) => a * b, "/": (a, b) => a / b,
    neg: (a) => -a, abs: Math.abs, hypot: Math.hypot, min: Math.min, max: Math.max,
    "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b,
    "==": (a, b) => a === b, "!=": (a, b) => a !== b,
    and: (...all) => all.every(Boolean), or: (...all) => all.some(Boolean), not: (a) => !a, if: (c, a, b) => (c ? a : b),
  };

  /** The value of `tree` at each step. `values` has an array for each name; all are as long as `values.t`. */
  function evaluate(tree, values) {
    const count = values.t.length;
    if (!Array.isArray(tree)) {
      if (tree === "inf") return new Array(count).fill(Infinity);
      if (typeof tree !== "string") return new Array(count).fill(tree);
      if (!values[tree]) throw new Error(`no channel ${tree}`);
      return values[tree];
    }
    const [operator, ...parts] = tree, of = parts.map((part) => evaluate(part, values));
    if (operator === "ever") return ever(of[0]);
    if (operator === "rate") return rate(of[0], values.t);
    const operation = OF_NUMBERS[operator], results = new Array(count);
    for (let i = 0; i < count; i++) results[i] = operation(...of.map((array) => array[i]));
    return results;
  }

  /** For each step, whether the condition has held so far. */
  function ever(holds) {
    let wasTrue = false;
    return holds.map((now) => (wasTrue = wasTrue || now));
  }

  /** The rate of change per second since the previous step; NaN in the first step. */
  const rate = (values, t) => Array.from(values, (value, i) => (i ? (value - values[i - 1]) / (t[i] - t[i - 1]) : NaN));

  return { evaluate };
})();
