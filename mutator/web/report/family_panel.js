// @ts-check
"use strict";
// The plots of the part "Families": a map of results over two parameters, and margins of golden runs over one. Both are drawn
// once they come into view.

/** A plot whose marks are outcomes. */
class FamilyPlot extends ValuePlot {
  markOf(ending) {
    return ending;
  }

  /** @param {any} point @returns {string} */
  words({ drive, what }) {
    return `${drive}: ${what}`;
  }
}

class FamilyPanel {
  static HAZARDS = "hazards"; // the choice that is no parameter

  /** `state` opens experiments; `has_rates`: whether counts of experiments are rates of a plan. */
  constructor(place, table, state, { has_rates = true } = {}) {
    if (!place) return;
    this.place = place;
    this.table = table;
    this.state = state;
    this.hasRates = has_rates;
    const show = async () => {
      if (this.observer) this.observer.disconnect();
      this.observer = null;
      this.data = await Packed.read("family-data");
      Chart.load();
      this.#build();
    };
    this.observer = new IntersectionObserver((entries) => entries.some(({ isIntersecting }) => isIntersecting) && show(), { rootMargin: "400px" });
    this.observer.observe(place);
  }

  #build() {
    const { el } = Dom, map = el("div.map-of-family"), margins = el("div.margins-of-family");
    const select = (id, onchange) => el("select", { id, onchange }), row = (...parts) => el("div.row", {}, parts);
    const label = (id, text) => el("label", { for: id }, text);
    this.family = select("plotted-family", () => this.#chooseFamily());
    this.family.append(...this.data.families.map(({ name }) => el("option", { value: name }, name)));
    this.x = select("map-x", () => this.#showMap());
    this.y = select("map-y", () => this.#showMap());
    this.over = select("margin-over", () => this.#showMargins());
    this.metric = select("margin-shown", () => this.#showMargins());
    this.counts = el("p.quiet", {});
    this.goldenCounts = el("p.quiet", {});
    this.marginFigure = el("figure", {}, el("figcaption", {}, "Without any fault: where the controller is near its edge"),
      row(label("margin-over", "Over:"), this.over, label("margin-shown", "Shown:"), this.metric), margins, this.goldenCounts);
    this.mapFigure = el("figure", {}, el("figcaption", {}, "The worst outcome of each concrete scenario"),
      row(label("map-x", "Across:"), this.x, label("map-y", "Up:"), this.y), map, this.counts);
    this.place.replaceChildren(this.data.families.length > 1 ? row(label("plotted-family", "Family:"), this.family) : "",
      el("div.two-plots", {}, this.mapFigure, this.marginFigure));
    const open = (at) => at >= 0 && this.state.set({ experiment: this.table.text(at, "experiment_id") }), describe = (at) => this.#describe(at);
    this.map = new FamilyPlot(map, { open, describe, groups: "Worst outcomes" });
    this.margins = new FamilyPlot(margins, { open, describe, groups: "Golden runs" });
    this.#chooseFamily();
  }

  #chooseFamily() {
    const { el } = Dom, family = this.data.families.find(({ name }) => name === this.family.value), { parameters, goldens } = family;
    const options = parameters.map((parameter) => el("option", { value: parameter.key }, FamilyPanel.#title(parameter)));
    const copies = () => options.map((option) => option.cloneNode(true));
    this.chosen = family;
    this.scenarios = this.#worstByScenario(family);
    this.x.replaceChildren(...copies());
    this.y.replaceChildren(...copies(), el("option", { value: FamilyPanel.HAZARDS }, `experiments with a hazard${this.hasRates ? " [%]" : ""}`));
    this.y.value = parameters[1]?.key ?? FamilyPanel.HAZARDS;
    this.over.replaceChildren(...copies());
    const metrics = this.data.metrics.filter(({ name }) => goldens.metrics[name]);
    this.metric.replaceChildren(...metrics.map((metric) => el("option", { value: metric.name, title: metric.about }, FamilyPanel.#title(metric))));
    const margin = metrics.find(({ name }) => name.startsWith("margin_"));
    if (margin) this.metric.value = margin.name;
    this.marginFigure.hidden = !metrics.length;
    this.mapFigure.hidden = !this.scenarios.size;
    if (this.scenarios.size) this.#showMap();
    if (metrics.length) this.#showMargins();
  }

  static #title({ name, unit }) {
    return `${name.replaceAll("_", " ")}${unit ? ` [${unit}]` : ""}`;
  }

  /** The concrete scenarios of a family that have listed experiments, by name: number of experiments and of hazards, and the row
   *  of the worst. */
  #worstByScenario({ name: family }) {
    const { table } = this, scenarios = new Map();
    for (let row = 0; row < table.count; row++) {
      if (table.text(row, "family") !== family || !table.usable(row)) continue;
      const name = table.text(row, "concrete_scenario"), before = scenarios.get(name) ?? { row, count: 0, hazards: 0 };
      const isWorse = table.number(row, "rank") < table.number(before.row, "rank"), isHazard = table.text(row, "outcome") === "hazard";
      scenarios.set(name, { row: isWorse ? row : before.row, count: before.count + 1, hazards: before.hazards + Number(isHazard) });
    }
    return scenarios;
  }

  #ending(row) {
    return this.table.text(row, "outcome").replaceAll("_", " ") || "crashed or timed out";
  }

  #describe(row) {
    if (row < 0) return "no experiment is listed";
    return `${this.table.text(row, "fault")}: ${this.table.text(row, "sentence") || this.#ending(row)}`;
  }

  /** An axis: its title and unit, the place of a value on it, and names of its ticks if values are texts.
   *  @returns {{axis: string, unit: string, at: (value: any) => number, ticks?: (chart: any, places: number[]) => string[]}} */
  #axis(key, values) {
    const parameter = this.chosen.parameters.find((each) => each.key === key);
    if (!parameter.is_text) return { axis: parameter.name.replaceAll("_", " "), unit: parameter.unit, at: Number };
    const names = [...new Set(values)].sort();
    return { axis: parameter.name.replaceAll("_", " "), unit: "", at: (value) => names.indexOf(value), ticks: (_, places) => places.map((place) => names[place] ?? "") };
  }

  /** An axis of the map, with the place of a scenario on it.
   *  @returns {{axis: string, unit: string, of: (scenario: any) => number, ticks?: (chart: any, places: number[]) => string[]}} */
  #axisOfRows(key) {
    if (key === FamilyPanel.HAZARDS) {
      const axis = "experiments with a hazard";
      return this.hasRates ? { axis, unit: "%", of: ({ hazards, count }) => (100 * hazards) / count } : { axis, unit: "", of: ({ hazards }) => hazards };
    }
    const { table } = this, rows = [...this.scenarios.values()].map(({ row }) => row), value = (row) => table.text(row, key);
    const axis = this.#axis(key, rows.map(value));
    return { ...axis, of: ({ row }) => axis.at(value(row)) };
  }

  #showMap() {
    const x = this.#axisOfRows(this.x.value), y = this.#axisOfRows(this.y.value), { table } = this;
    const rank = ({ row }) => table.number(row, "rank");
    const points = [...this.scenarios.values()].sort((a, b) => rank(b) - rank(a)).map((scenario) => ({
      row: scenario.row, x: x.of(scenario), y: y.of(scenario), scenario: this.#ending(scenario.row), drive: table.scenario(scenario.row),
      isHazard: scenario.hazards > 0, what: `the worst of ${scenario.count === 1 ? "one experiment" : `${scenario.count} experiments`} is ${this.#describe(scenario.row)}`,
    }));
    this.map.show({ name: this.chosen.name, axis: x.axis, unit: x.unit }, { title: y.axis, unit: y.unit }, points, [], { xValues: x.ticks, yValues: y.ticks });
    const hazards = points.filter(({ isHazard }) => isHazard).length, unlisted = table.of > table.count ? " Only listed experiments are drawn." : "";
    this.counts.textContent = `${points.length} concrete scenario${points.length === 1 ? "" : "s"}, ${hazards} with a hazard.${unlisted}`;
  }

  #showMargins() {
    const { goldens } = this.chosen, values = goldens.parameters[this.over.value], x = this.#axis(this.over.value, values);
    const metric = this.data.metrics.find(({ name }) => name === this.metric.value), heights = goldens.metrics[metric.name];
    const points = goldens.scenarios.map((name, at) => ({
      row: this.scenarios.get(name)?.row ?? -1, x: x.at(values[at]), y: heights[at] ?? NaN, scenario: goldens.hazards[at] ? "hazard without a fault" : "no hazard",
      drive: this.#label(at), isHazard: goldens.hazards[at] !== "",
      what: `${metric.name.replaceAll("_", " ")} ${Grid.number(heights[at] ?? NaN)}${metric.unit ? ` ${metric.unit}` : ""} without a fault${goldens.hazards[at] ? `, hazard ${goldens.hazards[at].replaceAll(";", ", ")}` : ""}`,
    })).filter(({ y }) => Number.isFinite(y));
    const limits = metric.name.startsWith("margin_") ? [[0, `limit of ${metric.name.slice(7).toUpperCase()}`]] : [];
    this.margins.show({ name: this.chosen.name, axis: x.axis, unit: x.unit }, { title: metric.name.replaceAll("_", " "), unit: metric.unit }, points, limits, { xValues: x.ticks });
    const drawn = goldens.scenarios.length < goldens.of ? `, of ${goldens.of}` : "";
    this.goldenCounts.textContent = `${points.length} golden runs${drawn}. ${metric.about ? `${metric.about[0].toUpperCase()}${metric.about.slice(1)}.` : ""}`;
  }

  /** The values of a golden run's scenario, as `Rows.Table.scenario` has them. */
  #label(at) {
    const { parameters, goldens } = this.chosen;
    return parameters.map(({ key, name, unit }) => `${name} ${goldens.parameters[key][at]}${unit ? ` ${unit}` : ""}`).join(", ");
  }
}
