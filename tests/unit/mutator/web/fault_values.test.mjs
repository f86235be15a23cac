import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { Rows, FaultValues } = load("report/rows.js", "report/fault_values.js");

const dictionary = (name, ...values) => {
  const words = [...new Set(values)];
  return { name, words, codes: values.map((value) => words.indexOf(value)) };
};
const TABLE = new Rows.Table({
  count: 6,
  checked: ["X1"],
  labels: {},
  severities: { S2: "severe (severity S2)" },
  columns: [
    dictionary("kind", "gap/bias", "gap/bias", "gap/bias", "gap/noise", "gap/bias", "gap/bias"),
    dictionary("variant", "far", "far", "far", "", "far", "far"),
    dictionary("unit", "m", "m", "m", "-", "ft", "m"),
    dictionary("scenario", "S1", "S2", "S1", "S1", "S1", "S1"),
    dictionary("hazards", "X1", "", "", "X1", "", ""),
    dictionary("status", "ok", "ok", "ok", "ok", "ok", "harness_error"),
    { name: "value", numbers: [3, 1, 2, null, 5, 9] },
    { name: "t_activation", numbers: [1, 1, null, 1, 1, 1] },
    { name: "time_to_hazard", numbers: [2.5, null, null, 0.5, null, null] },
    { name: "margin_x1", numbers: [-1, 4, 4, -2, "Infinity", 0] },
    { name: "delta_v", numbers: [6, null, null, null, null, null] },
    { name: "rank", numbers: [2, 3, 4, 1, 5, 6] },
  ],
});
const FACTS = {
  metrics: [["t_end", "s", "the end", "lower"], ["delta_v", "m/s", "change of speed", "higher"], ["margin_x1", "m", "distance", "lower"]],
  hazards: [{ name: "X1", about: "too near" }],
  severity: { classes: [["S0", 0, "none"], ["S2", 5, "severe"]] },
};
const { faults, without } = FaultValues.faultsOf(TABLE);
const measures = FaultValues.measuresOf(TABLE, FACTS);

test("faults are apart by name and unit, and those without a number are only counted", () => {
  assert.deepEqual(faults.map(({ key, rows }) => [key, rows]), [["gap/bias/far [ft]", [4]], ["gap/bias/far [m]", [0, 1, 2]]]);
  assert.deepEqual([...without], [["gap/noise", 1]]);
});

test("measures are margins with their limit, then delta-v with the classes, and the time to hazard", () => {
  assert.deepEqual(measures.map(({ name, limits }) => [name, limits]), [["margin_x1", [[0, "limit of X1"]]], ["delta_v", [[5, "severe (severity S2)"]]], ["time_to_hazard", []]]);
  assert.equal(measures[0].about, "X1: too near");
});

test("points are sorted by value, without inactive faults and infinite margins, which are counted", () => {
  const metres = FaultValues.pointsOf(TABLE, faults[1], measures[0]);
  assert.deepEqual(metres.points.map(({ row, x, y, isHazard }) => [row, x, y, isHazard]), [[1, 1, 4, false], [0, 3, -1, true]]);
  assert.equal(metres.inactive, 1);
  assert.equal(FaultValues.pointsOf(TABLE, faults[0], measures[0]).unlimited, 1);
});

test("a plot begins with the fault of the worst experiment that has a value, and the margin that it is beyond", () => {
  assert.equal(FaultValues.worstOf(TABLE, faults).key, "gap/bias/far [m]");
  assert.equal(FaultValues.firstMeasure(TABLE, faults[1], measures).name, "margin_x1");
});

test("a hazard exactly at a reaction time has come by then", () => {
  const times = FaultValues.timesOf(TABLE, [0, 1, 3]);
  assert.deepEqual([...times], [0.5, 2.5]);
  assert.deepEqual([0, 0.5, 2.4, 2.5, 9].map((limit) => FaultValues.countWithin(times, limit)), [0, 1, 1, 2, 2]);
});
