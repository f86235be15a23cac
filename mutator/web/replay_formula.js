"use strict";
// Formulas and conditions of a manifest over the steps of a run, as Python has them (triggers/over_time.py). They
// come as trees (triggers/trees.py): numbers, names, and lists of an operator and what it is of.

const Formula = (() => {
  const OF_NUMBERS = {
    "+": (a, b) => a + b, "-": (a, b) => a - b, "*": (a, b) => a * b, "/": (a, b) => a / b,
    neg: (a) => -a, abs: Math.abs, hypot: Math.hypot, min: Math.min, max: Math.max,
    "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b,
    "==": (a, b) => a === b, "!=": (a, b) => a !== b,
    and: (...all) => all.every(Boolean), or: (...all) => all.some(Boolean), not: (a) => !a, if: (c, a, b) => (c ? a : b),
  };

  /** Each step's value of `tree`; `values` has an array for each name, all as long as `values.t`. */
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
    const one = OF_NUMBERS[operator], made = new Array(count);
    for (let i = 0; i < count; i++) made[i] = one(...of.map((array) => array[i]));
    return made;
  }

  /** Whether it has held by then. */
  function ever(holds) {
    let found = false;
    return holds.map((now) => (found = found || now));
  }

  /** The change in a second since the step before; NaN in the first. */
  const rate = (values, t) => Array.from(values, (value, i) => (i ? (value - values[i - 1]) / (t[i] - t[i - 1]) : NaN));

  return { evaluate };
})();
