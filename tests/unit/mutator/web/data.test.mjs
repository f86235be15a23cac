import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { ReplayData } = load("replay/data.js");

const channel = (golden, faulty = golden) => ({ t: golden.map((_, i) => i), golden, faulty });

test("the sample at a time is the last one that is not later", () => {
  const indices = [-1, 0, 0.9, 1, 2.5, 99].map((t) => ReplayData.index([0, 1, 2], t));
  assert.deepEqual(indices, [0, 0, 0, 1, 2, 2]);
});

test("a channel has no value before its first sample", () => {
  const late = { t: [1, 2], golden: [5, 6], faulty: [5, 7] };
  assert.deepEqual([0.5, 1, 3].map((t) => ReplayData.valueAt(late, "faulty", t)), [NaN, 5, 7]);
});

test("the largest difference ignores what follows the end of the drive", () => {
  const { by, t } = ReplayData.largest(channel([0, 0, 0, 0], [0, 2, -3, 9]), 2);
  assert.deepEqual([by, t], [3, 2]);
});

test("a missing value against a value is a difference of unknown size", () => {
  assert.deepEqual(ReplayData.largest(channel([0, 0], [0, NaN]), 1), { by: NaN, t: 1 });
  assert.deepEqual(ReplayData.largest(channel([0, NaN]), 1), { by: 0, t: NaN });
});

test("the difference as a share of the axis is a root mean square", () => {
  const axis = { low: 0, high: 10 };
  assert.equal(ReplayData.apart(channel([0, 0], [5, 5]), axis, 0, 1), 0.5);
  assert.equal(ReplayData.apart(channel([0, 0], [0, 10]), axis, 0, 1), Math.SQRT1_2);
  assert.equal(ReplayData.apart(channel([0, 0], [NaN, NaN]), axis, 0, 1), 1);
});

test("a few huge values do not hide all others", () => {
  const values = Array.from({ length: 100 }, (_, i) => i % 10);
  const { high, cut } = ReplayData.range(channel([...values, 1e9]), 1000);
  assert.ok(high < 20);
  assert.deepEqual(cut, [0, 1e9]);
  const { low } = ReplayData.range(channel([...values, -1e9]), 1000);
  assert.ok(low > -20 && low < 0);
  assert.equal(ReplayData.range(channel(values), 1000).cut, null);
});

test("ticks are round numbers within the axis", () => {
  assert.deepEqual(ReplayData.ticks(0, 1, 5), [0, 0.2, 0.4, 0.6, 0.8, 1]);
  assert.deepEqual(ReplayData.ticks(-30, 70, 4), [0, 50]);
});

test("decimals follow the size of the axis", () => {
  const digits = (high, isWhole = false) => ReplayData.digits({ low: 0, high, isWhole });
  assert.deepEqual([digits(0.05), digits(0.5), digits(5), digits(500), digits(5e9), digits(5, true)], [4, 3, 3, 1, 0, 0]);
});

test("values have a true minus sign, but never a negative zero", () => {
  const texts = [-1.25, -0.001, NaN, Infinity, -Infinity, 12_345_678].map((value) => ReplayData.text(value, 1));
  assert.deepEqual(texts, ["−1.3", "0.0", "–", "∞", "−∞", "1.2e+7"]);
});

test("units have exponents, and none is shown for a plain number", () => {
  assert.deepEqual(["m/s^2", "m/s^3", "-", undefined].map((unit) => ReplayData.unit({ unit })), ["m/s²", "m/s³", "", ""]);
});
