// @ts-check
"use strict";
// The map of fault type by scenario. Each cell shows a share, or a metric's median or worst value, as text and colour, and
// describes its 95 % interval where there are rates. Selecting a cell sets the filters. Rows and columns with nothing to count are named below.

class HeatMap {
  static ROW = "kind";
  static COLUMN = "scenario";
  /** Facets that do not filter the map: its two axes, and the results that it counts. */
  static FREE = ["kind", "scenario", "outcome", "status", "severity", "hazards", "alerts", "warning", "reached", "stopped_at", "through"];

  constructor(place, picker, table, state, { metrics = [], has_rates = true } = {}) {
    this.place = place;
    this.hasRates = has_rates; // not those of an even sample or an exploration
    this.table = table;
    this.state = state;
    const find = (name) => table.facets.find((f) => f.name === name);
    this.rows = table.map ? { values: table.map.kinds } : find(HeatMap.ROW);
    this.columns = table.map ? { values: table.map.scenarios } : find(HeatMap.COLUMN);
    const groups = [["Shares", HeatMap.shares(table)], ["Severity", HeatMap.severities(table)], ["Metrics of activated faults", HeatMap.values(table, metrics)]];
    this.measures = groups.flatMap(([, measures]) => measures);
    picker.append(...groups.filter(([, measures]) => measures.length).map(([label, measures]) =>
      Dom.el("optgroup", { label }, measures.map((m) => Dom.el("option", { value: m.name }, m.title)))));
    picker.addEventListener("change", () => state.set({ heat: picker.value === this.measures[0].name ? "" : picker.value }));
    this.picker = picker;
  }

  /** For each severity class, the share of activated faults with a hazard of at least that class. */
  static severities(table) {
    const facet = table.facets.find((f) => f.name === "severity");
    const classes = facet ? facet.values.filter((value) => value !== facet.none).sort() : [];
    return classes.map((name) => ({
      name: `severity-${name}`, title: `${table.called("severity", name)} or worse / activated`,
      part: (row) => table.text(row, "severity") >= name, of: (row) => table.text(row, "t_activation") !== "",
    }));
  }

  /** The median and worst value of each metric over activated faults. */
  static values(table, metrics) {
    const of = (row) => table.text(row, "t_activation") !== "";
    return metrics.filter(([name]) => table.columns.get(name)?.numbers).flatMap(([name, unit, , worse]) => ["median", "worst"].map((which) => ({
      name: `${which}-${name}`, title: `${which} ${name.replaceAll("_", " ")}${unit && unit !== "-" ? ` [${unit}]` : ""}`,
      value: (row) => table.number(row, name), of, which, turn: worse === "higher" ? 1 : -1,
    })));
  }

  /** The shares, each with the rows that it counts and the rows in its base. */
  static shares(table) {
    const has = (name) => (row) => table.text(row, name) !== "";
    const isActive = has("t_activation"), isHazard = has("hazards"), isAlert = has("alerts"), all = () => true;
    const measures = [
      { name: "hazards", title: "hazards / activated", part: isHazard, of: isActive },
      { name: "hazards-injected", title: "hazards / injected", part: isHazard, of: all },
      { name: "activated", title: "activated / injected", part: isActive, of: all },
      { name: "manifested", title: "manifested / activated", part: has("t_manifest"), of: isActive },
    ];
    if (table.columns.has("alerts")) measures.push(
      { name: "alerts", title: "alerts / activated", part: isAlert, of: isActive },
      { name: "silent", title: "silent hazards (no alert before) / hazards", part: (row) => table.text(row, "reaction_time") === "", of: isHazard },
      { name: "no-alert", title: "hazards with no alert at all / hazards", part: (row) => !isAlert(row), of: isHazard },
    );
    if (table.checked.length < 2) return measures;
    const each = table.checked.map((hazard) => ({
      name: hazard, title: `${hazard} / activated`, of: isActive, part: has(`t_${hazard.toLowerCase()}`),
    }));
    return [...measures, ...each];
  }

  /** Count `rows` and show them. */
  show(rows) {
    const measure = this.measures.find((m) => m.name === this.state.heat) || this.measures[0];
    this.picker.value = measure.name;
    if (!this.rows || !this.columns) return;
    const width = this.columns.values.length + 1, height = this.rows.values.length + 1;
    if (this.table.map) {
      const cells = this.table.map.cells[measure.name];
      this.#draw(measure, measure.value ? this.#coloured(measure, cells) : cells.map(([n, all]) => this.#shareOf(n, all)), width);
      return;
    }
    const cells = Array.from({ length: width * height }, () => []);
    for (const row of rows) {
      if (!this.table.usable(row) || !measure.of(row)) continue;
      const value = measure.value ? measure.value(row) : measure.part(row);
      if (Number.isNaN(value)) continue; // this run has no value
      const [y] = this.rows.members[this.rows.codes[row]], [x] = this.columns.members[this.columns.codes[row]];
      // last row and column: totals
      for (const at of [y * width + x, y * width + width - 1, (height - 1) * width + x, height * width - 1]) cells[at].push(value);
    }
    this.#draw(measure, measure.value ? this.#summaries(measure, cells) : cells.map((values) => this.#shareOf(values.filter(Boolean).length, values.length)), width);
  }

  /** The text, description and colour (0 to 1) of each cell of a share. */
  #shareOf(n, all) {
    const interval = this.hasRates && all ? `, ${HeatMap.interval(n, all)}` : "";
    return { all, text: `${n}/${all}`, what: all ? `${n} of ${all}${interval}` : "", rate: all ? n / all : 0 };
  }

  /** The text, description and colour of each cell of a metric. The worst cell has full colour. */
  #summaries({ which, turn }, cells) {
    return this.#coloured({ which, turn }, cells.map((values) => {
      const sorted = values.sort((a, b) => turn * (a - b)), middle = (sorted.length - 1) / 2;
      if (!sorted.length) return [NaN, 0];
      if (which === "worst") return [sorted.at(-1), sorted.length];
      const rank = HeatMap.rankOfBound(sorted.length), ends = rank ? [sorted.at(rank - 1), sorted.at(-rank)].sort((a, b) => a - b) : [];
      return [(sorted[Math.floor(middle)] + sorted[Math.ceil(middle)]) / 2, sorted.length, ...ends];
    }));
  }

  /** The text, description and colour of values (null: no value), each given with its number of runs and, for a median, the ends
   *  of its interval. */
  #coloured({ which, turn }, valuesWithCounts) {
    const values = valuesWithCounts.map(([value]) => value ?? NaN);
    const finite = values.filter(Number.isFinite), low = Math.min(...finite), high = Math.max(...finite);
    const rate = (value) => (high > low && Number.isFinite(value) ? (turn > 0 ? value - low : high - value) / (high - low) : 0);
    const what = (value, [, count, ...ends]) => {
      if (which === "worst") return `${Grid.number(value)}, a bound from ${count} runs`;
      if (!this.hasRates) return `${Grid.number(value)}, over ${count}`;
      return `${Grid.number(value)} (${ends.length ? ends.map((end) => Grid.number(end ?? Infinity)).join(" to ") : "too few runs for an interval"}), over ${count}`;
    };
    return values.map((value, at) => ({ all: valuesWithCounts[at][1], text: Grid.number(value), what: what(value, valuesWithCounts[at]), rate: rate(value) }));
  }

  /** The rank of the lower end of the 95 % interval of a median among `count` sorted values (the sign test's): the largest for which
   *  fewer values lie below the median with a probability of 2.5 % at most; 0 if there is none. */
  static rankOfBound(count) {
    let logarithm = count * Math.log(0.5), sum = 0, rank = 0;
    for (; (sum += Math.exp(logarithm)) <= 0.025; rank++) logarithm += Math.log((count - rank) / (rank + 1));
    return rank;
  }

  #draw(measure, cells, width) {
    const { el } = Dom;
    const kinds = [...this.rows.values, null], scenarios = [...this.columns.values, null];
    const focused = this.place.contains(document.activeElement) ? document.activeElement.dataset.at : null;
    const bottom = kinds.length - 1, right = scenarios.length - 1; // the totals
    const rows = [...kinds.keys()].filter((y) => cells[y * width + right].all), columns = [...scenarios.keys()].filter((x) => cells[bottom * width + x].all);
    const cell = (y, x) => {
      const { all, text, what, rate } = cells[y * width + x];
      const where = `${kinds[y] || "all fault types"} in ${scenarios[x] || "all scenarios"}`;
      if (!all) return el("td", { title: `${where}\n${measure.title}: none to count` });
      const isChosen = this.#isChosen(HeatMap.ROW, kinds[y]) && this.#isChosen(HeatMap.COLUMN, scenarios[x]);
      return el("td", {}, el("button.cell", {
        type: "button", "data-at": `${y},${x}`, "aria-pressed": String(isChosen && this.#isAny), style: `--rate: ${rate.toFixed(3)}`,
        class: `cell${rate > 0.55 ? " strong" : ""}`,
        title: `${where}\n${measure.title}: ${what}`, "aria-label": `${where}: ${measure.title} ${what}`,
        onclick: () => this.#choose(kinds[y], scenarios[x], isChosen && this.#isAny),
      }, text));
    };
    const head = el("tr", {}, el("td"), columns.map((x) => el("th", { scope: "col", title: this.table.meaning(HeatMap.COLUMN, scenarios[x]) }, scenarios[x] || "all")));
    const body = rows.map((y) =>
      el("tr", {}, el("th", { scope: "row" }, kinds[y] ? kinds[y].split(/(?<=[/_])/).flatMap((part) => [part, el("wbr")]) : "all"), columns.map((x) => cell(y, x))));
    this.place.replaceChildren(el("table.heat", { "aria-label": `${measure.title} by fault type and scenario` },
      el("thead", {}, head), el("tbody", {}, body)), HeatMap.#omitted(kinds.filter((_, y) => !rows.includes(y)), scenarios.filter((_, x) => !columns.includes(x))));
    if (focused) this.place.querySelector(`[data-at="${focused}"]`)?.focus();
  }

  /** The names of the rows and columns with nothing to count. */
  static #omitted(kinds, scenarios) {
    const named = (noun, names) => (names.length ? [`${noun}${names.length > 1 ? "s" : ""} ${names.join(", ")}`] : []);
    const parts = [...named("fault type", kinds.filter(Boolean)), ...named("scenario", scenarios.filter(Boolean))];
    return parts.length ? Dom.el("p.quiet.omitted", {}, `Nothing to count: ${parts.join("; ")}.`) : "";
  }

  get #isAny() {
    return this.state.chosen.has(HeatMap.ROW) || this.state.chosen.has(HeatMap.COLUMN);
  }

  /** Whether `value` is the only chosen value of a facet; null: whether no value is chosen. */
  #isChosen(name, value) {
    const chosen = this.state.chosen.get(name);
    return value === null ? !chosen : Boolean(chosen) && chosen.size === 1 && chosen.has(value);
  }

  #choose(kind, scenario, wasChosen) {
    const values = (value) => (wasChosen || value === null ? [] : [value]);
    this.state.choose({ [HeatMap.ROW]: values(kind), [HeatMap.COLUMN]: values(scenario) });
  }

  /** The rate and its 95 % Wilson interval, such as `30 % (18 to 45)`. */
  static interval(n, all) {
    const z = 1.959964, p = n / all, scale = 1 + (z * z) / all;
    const middle = (p + (z * z) / (2 * all)) / scale;
    const half = (z / scale) * Math.sqrt((p * (1 - p)) / all + (z * z) / (4 * all * all));
    const percent = (x) => (100 * Math.min(1, Math.max(0, x))).toFixed(1);
    return `${percent(p)} % (${percent(middle - half)} to ${percent(middle + half)})`;
  }
}
