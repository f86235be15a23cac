import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { TimePlot } = load("report/fault_values.js", "report/time_plot.js");
const TIMES = { all: [0.5, 1, 4, 6], of: [0.5, 6], name: "gap/bias", reaction: 2.5 };

test("the sentence has shares of the hazards within a reaction time", () => {
  assert.match(TimePlot.sentence(TIMES), /^Within 2.5 s .* 2 of 4 hazards of all faults \(50 %\), and 1 of 2 hazards of gap\/bias \(50 %\)\./);
});

test("where counts are no rates, the sentence has counts alone", () => {
  const sentence = TimePlot.sentence({ ...TIMES, hasRates: false });
  assert.match(sentence, / 2 of 4 hazards of all faults, and 1 of 2 hazards of gap\/bias\./);
  assert.doesNotMatch(sentence, /%/);
});
