// @ts-check
"use strict";
// The points of the plots of value and margin: which faults have values, what a plot can measure, and its rows.

const FaultValues = (() => {
  const TIME = "time_to_hazard", DELTA_V = "delta_v", END = "t_end";

  /** The drawn value of a row as a number; NaN if it has no single number, as a mutant of an operator has none. */
  function valueOf(table, row) {
    const text = table.text(row, "value");
    return text === "" || table.text(row, "module") === "operators" ? NaN : Number(text);
  }

  const nameOf = (table, row) => [table.text(row, "kind"), table.text(row, "variant")].filter(Boolean).join("/");

  /** The faults of a table: `faults` ({name, kind, unit, rows}), which have numbers as values, and `without`, the number of
   *  rows by fault without any. The same name with another unit is another fault. */
  function faultsOf(table) {
    const faults = new Map(), without = new Map();
    for (let row = 0; row < table.count; row++) {
      if (!table.usable(row)) continue;
      const name = nameOf(table, row), unit = table.text(row, "unit"), key = `${name} [${unit}]`;
      if (Number.isNaN(valueOf(table, row))) without.set(name, (without.get(name) ?? 0) + 1);
      else if (faults.has(key)) faults.get(key).rows.push(row);
      else faults.set(key, { key, name, kind: table.text(row, "kind"), unit: unit === "-" ? "" : unit, rows: [row] });
    }
    return { faults: [...faults.values()].sort((a, b) => a.key.localeCompare(b.key, "en", { numeric: true })), without };
  }

  /** What a plot can have on y: {name, title, unit, group, limits}. `metrics` are [name, unit, about, worse]; a limit is
   *  [value, words]. The limit of a margin is 0, those of delta-v begin the classes of severity. */
  function measuresOf(table, { metrics = [], hazards = [], severity = null }) {
    const about = new Map(hazards.map((hazard) => [`margin_${hazard.name.toLowerCase()}`, hazard]));
    const bounds = (severity?.classes ?? []).filter(([, least]) => least > 0).map(([name, least]) => [least, table.called("severity", name)]);
    const measures = metrics.filter(([name]) => name !== END && table.columns.get(name)?.numbers).map(([name, unit, meaning]) => {
      const hazard = about.get(name), title = hazard ? `margin to ${hazard.name}` : name.replaceAll("_", " ");
      const limits = hazard ? [[0, `limit of ${hazard.name}`]] : name === DELTA_V ? bounds : [];
      return { name, title, about: hazard?.about ? `${hazard.name}: ${hazard.about}` : meaning, unit: unit === "-" ? "" : unit, limits,
        group: hazard ? "Margins" : name === DELTA_V ? "Severity and time" : "Other metrics" };
    });
    if (table.columns.get(TIME)?.numbers) {
      measures.push({ name: TIME, title: "time to hazard", about: "from the activation to the first hazard", unit: "s", group: "Severity and time", limits: [] });
    }
    const groups = ["Margins", "Severity and time", "Other metrics"];
    return measures.sort((a, b) => groups.indexOf(a.group) - groups.indexOf(b.group));
  }

  /** The points of a fault, by value: {points: [{row, x, y, scenario, drive, isHazard}], inactive, unlimited}. Rows whose fault was
   *  never active or that have no finite `y` are only counted. */
  function pointsOf(table, fault, measure) {
    const points = [], left = { inactive: 0, unlimited: 0 };
    for (const row of fault.rows) {
      const y = table.number(row, measure.name);
      if (table.text(row, "t_activation") === "") left.inactive++;
      else if (!Number.isFinite(y)) left.unlimited++;
      else points.push({ row, x: valueOf(table, row), y, scenario: table.text(row, "scenario"), drive: table.scenario(row), isHazard: table.text(row, "hazards") !== "" });
    }
    return { points: points.sort((a, b) => a.x - b.x || a.y - b.y), ...left };
  }

  /** The times to the first hazard (s) of rows with a hazard, sorted. */
  const timesOf = (table, rows) => Float64Array.from(rows.map((row) => table.number(row, TIME)).filter((time) => !Number.isNaN(time))).sort();

  /** The number of sorted `times` that are not later than a time. */
  function countWithin(times, limit) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= limit + 1e-9) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The fault with which to begin: that of the worst row. */
  function worstOf(table, faults) {
    const rank = (fault) => fault.rows.reduce((least, row) => Math.min(least, table.number(row, "rank")), Infinity);
    return faults.map((fault) => [fault, rank(fault)]).sort((a, b) => a[1] - b[1])[0]?.[0] ?? null;
  }

  /** The measure with which a fault begins: the margin that most of its points are beyond; of equals, the first. */
  function firstMeasure(table, fault, measures) {
    const beyond = (measure) => fault.rows.filter((row) => table.number(row, measure.name) <= 0).length;
    const margins = measures.filter(({ group }) => group === "Margins");
    return margins.map((measure) => [measure, beyond(measure)]).sort((a, b) => b[1] - a[1])[0]?.[0] ?? measures[0] ?? null;
  }

  return { faultsOf, measuresOf, pointsOf, timesOf, countWithin, worstOf, firstMeasure, valueOf, TIME };
})();
