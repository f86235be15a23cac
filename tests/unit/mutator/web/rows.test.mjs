import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { Rows } = load("report/rows.js");

const dictionary = (name, ...values) => {
  const words = [...new Set(values)];
  return { name, words, codes: values.map((value) => words.indexOf(value)) };
};
const TABLE = new Rows.Table({
  count: 5,
  checked: [],
  labels: { a: "first part" },
  columns: [
    { name: "experiment_id", texts: ["aaaa11", "aaaa22", "bbbb33", "cccc44", "dddd55"] },
    dictionary("kind", "stuck", "stuck", "noise", "noise", "noise"),
    dictionary("scenario", "S10", "S2", "S2", "S10", "S2"),
    dictionary("hazards", "X1;X2", "", "X2", "", ""),
    dictionary("status", "ok", "ok", "ok", "harness_error", "ok"),
    { name: "t_hazard", numbers: [7, null, 3, null, "Infinity"] },
  ],
}, { hazards: { X1: "too near" } });
const search = (query, chosen = {}, free = []) => TABLE.filter(query, new Map(Object.entries(chosen).map(([name, of]) => [name, new Set(of)])), free);

test("all words of a search must be in a row, in any column", () => {
  assert.deepEqual(search("").rows, [0, 1, 2, 3, 4]);
  assert.deepEqual(search("STUCK s2").rows, [1]);
  assert.deepEqual(search("stuck noise").rows, []);
});

test("comparisons select rows by number or text, and empty cells only with none", () => {
  assert.deepEqual(search("t_hazard<5").rows, [2]);
  assert.deepEqual(search("t_hazard>=7").rows, [0, 4]);
  assert.deepEqual(search("t_hazard=none").rows, [1, 3]);
  assert.deepEqual(search("kind=noise t_hazard<5").rows, [2]);
});

test("a row matches a filter with any of its values", () => {
  assert.deepEqual(search("", { hazards: ["X2"] }).rows, [0, 2]);
  assert.deepEqual(search("", { hazards: ["no hazard"] }).rows, [1, 3, 4]);
  assert.deepEqual(search("", { hazards: ["X1", "no hazard"], kind: ["stuck"] }).rows, [0, 1]);
});

test("the counts of a filter obey the other filters, not its own choice", () => {
  const { counts } = search("", { kind: ["stuck"], scenario: ["S2"] });
  const of = (name) => Object.fromEntries(TABLE.facets.find((facet) => facet.name === name).values.map((value, i) => [value, counts.get(name)[i]]));
  assert.deepEqual(of("kind"), { stuck: 1, noise: 2 });
  assert.deepEqual(of("scenario"), { S2: 1, S10: 1 });
  assert.deepEqual(of("hazards"), { "no hazard": 1, X1: 0, X2: 0 });
});

test("rows for a map ignore the filters that the map shows", () => {
  const { rows, apart } = search("", { kind: ["stuck"], scenario: ["S2"] }, ["kind"]);
  assert.deepEqual([rows, apart], [[1], [1, 2, 4]]);
});

test("the values of a filter are in natural order", () => {
  assert.deepEqual(TABLE.facets.find(({ name }) => name === "scenario").values, ["S2", "S10"]);
});

test("sorting puts empty cells last in both directions and keeps the order of equal rows", () => {
  const all = [0, 1, 2, 3, 4];
  assert.deepEqual(TABLE.sort(all, "t_hazard", false), [2, 0, 4, 1, 3]);
  assert.deepEqual(TABLE.sort(all, "t_hazard", true), [4, 0, 2, 1, 3]);
  assert.deepEqual(TABLE.sort(all, "scenario", false), [1, 2, 4, 0, 3]);
  assert.deepEqual(TABLE.sort(all, "nothing", false), all);
});

test("an experiment is found by its id or a unique prefix of at least four digits", () => {
  assert.deepEqual(["bbbb33", "bbbb", "bbb", "aaaa", "aaaa2", "eeee"].map((id) => TABLE.find(id)), [2, 2, -1, -1, 1, -1]);
});

test("rows without a valid result are not usable for counts", () => {
  assert.deepEqual([0, 1, 2, 3, 4].filter(TABLE.usable), [0, 1, 2, 4]);
});

test("labels and meanings replace codes", () => {
  assert.equal(TABLE.called("reached", "a→b;a"), "first part → b, first part");
  assert.equal(TABLE.called("kind", "a"), "a");
  assert.equal(TABLE.meaning("hazards", "X1;X2"), "too near");
  assert.equal(TABLE.meaning("kind", "stuck"), null);
});

test("unknown columns, filters and values are named", () => {
  const state = { query: "speed<3", chosen: new Map([["kind", new Set(["drift"])], ["scenario", new Set(["S2"])]]), unknown: ["colour"] };
  assert.deepEqual(TABLE.unknown(state), [
    'This page has no filter "colour"',
    'There is no column "speed" to search',
    'No experiment has kind "drift"',
  ]);
});

const DRIVES = new Rows.Table({
  count: 4,
  checked: [],
  labels: {},
  severities: { S1: "light (severity S1)", S2: "severe (severity S2)" },
  columns: [
    { name: "experiment_id", texts: ["aaaa11", "aaaa22", "bbbb33", "cccc44"] },
    { name: "fault", texts: ["radar/chaff/distance 40 m", "radar/chaff/distance 40 m", "a/noise/x", "a/noise/x"] },
    dictionary("kind", "radar/chaff", "radar/chaff", "a/noise", "a/noise"),
    dictionary("scenario", "S1", "S2", "S2", "S1"),
    dictionary("ending", "hazard", "hazard", "not_activated", "crashed"),
    dictionary("outcome", "hazard", "hazard", "not_activated", ""),
    dictionary("severity", "S2", "S1", "", ""),
    dictionary("alerts", "", "fcw;late", "", "fcw"),
    dictionary("warning", "no alert at all", "alert before the hazard", "", ""),
  ],
});
const drives = (query) => DRIVES.filter(query, new Map()).rows;
const state = (query, chosen = {}) => ({ query, chosen: new Map(Object.entries(chosen).map(([name, of]) => [name, new Set(of)])), unknown: [] });

test("a search finds the words that the page shows", () => {
  assert.deepEqual(drives("silent"), [0]);
  assert.deepEqual(drives("silent hazard"), [0]);
  assert.deepEqual(drives("no alert"), [0, 2]);
  assert.deepEqual(drives("no alert at all"), [0]);
  assert.deepEqual(drives("no class"), [2, 3]);
  assert.deepEqual(drives("not activated"), [2]);
  assert.deepEqual(drives("no outcome"), [3]);
  assert.deepEqual(drives("radar/chaff/distance s1"), [0]);
  assert.deepEqual(drives('"distance 40 m" s2'), [1]);
});

test("a scenario and a severity class are not confused", () => {
  assert.deepEqual(drives("s1"), [0, 3]);
  assert.deepEqual(drives("severe"), [0]);
  assert.deepEqual(drives("severe (severity s2)"), [0]);
  assert.deepEqual(drives("severity>=s2"), [0]);
});

test("a word for an alert does not find runs without one", () => {
  assert.deepEqual(drives("alert"), []);
  assert.deepEqual(drives("fcw"), [1, 3]);
});

test("a search without a result says why", () => {
  assert.match(DRIVES.nothing(state("chaff xyz"))[0], /^No experiment has "xyz" in its id, fault, /);
  assert.match(DRIVES.nothing(state("chaff crashed"))[0], /none has all/);
  assert.match(DRIVES.nothing(state("", { scenario: ["S1"], outcome: ["not_activated"] }))[0], /chosen values/);
});
