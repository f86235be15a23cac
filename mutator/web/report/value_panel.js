// @ts-check
"use strict";
// The part "Value and margin" of a report: chooses fault and measure, and draws its plots once they come into view.

class ValuePanel {
  static MOST_NAMES = 8; // faults without a value that are named

  /** `state` has the choices, and opens experiments. */
  constructor(place, table, state, facts) {
    this.place = place;
    this.table = table;
    this.state = state;
    this.facts = facts;
    this.drawn = null; // what the plots show
    if (!place) return;
    const show = () => {
      if (this.observer) this.observer.disconnect();
      this.observer = null;
      Chart.load();
      this.#build();
      this.show();
    };
    this.observer = new IntersectionObserver((entries) => entries.some(({ isIntersecting }) => isIntersecting) && show(), { rootMargin: "400px" });
    this.observer.observe(place);
    addEventListener("beforeprint", () => this.observer && show());
  }

  #build() {
    const { el } = Dom, { table, state, place, facts } = this, { faults, without } = FaultValues.faultsOf(table);
    this.faults = faults;
    this.measures = FaultValues.measuresOf(table, facts);
    const rows = Array.from({ length: table.count }, (_, row) => row).filter((row) => table.usable(row));
    this.times = FaultValues.timesOf(table, rows);
    if (!faults.length || !this.measures.length) {
      place.replaceChildren(el("p", {}, "No fault of this run has a single number as its value."));
      return;
    }
    const grouped = (items, group, option) => [...new Set(items.map(group))].map((label) => el("optgroup", { label }, items.filter((item) => group(item) === label).map(option)));
    this.faultPicker = el("select", { id: "plotted-fault", onchange: () => state.set({ plot: { ...state.plot, fault: this.faultPicker.value, y: "" } }) },
      grouped(faults, ({ kind }) => kind, ({ key, name, unit }) => el("option", { value: key }, unit ? `${name} [${unit}]` : name)));
    this.measurePicker = el("select", { id: "plotted-measure", onchange: () => state.set({ plot: { ...state.plot, y: this.measurePicker.value } }) },
      grouped(this.measures, ({ group }) => group, ({ name, title, unit }) => el("option", { value: name }, unit ? `${title} [${unit}]` : title)));
    this.reaction = el("input", { id: "reaction-time", type: "number", min: 0, max: 60, step: 0.1, onchange: () => this.#setReaction() });
    this.counts = el("p.quiet", {});
    const values = el("div.values"), times = el("div.times");
    place.replaceChildren(
      el("div.row", {}, el("label", { for: "plotted-fault" }, "Fault:"), this.faultPicker, el("label", { for: "plotted-measure" }, "Shown:"), this.measurePicker),
      el("div.two-plots", {},
        el("figure", {}, el("figcaption", {}, this.caption = el("span")), values, this.counts),
        el("figure", {}, el("figcaption", {}, "How soon hazards come: all faults ", el("span.line.of-all"), " and this fault ", el("span.line.of-fault")),
          el("div.row", {}, el("label", { for: "reaction-time" }, "Reaction time [s]:"), this.reaction), times)),
      ValuePanel.#withoutValue(without));
    this.plot = new ValuePlot(values, { open: (row) => state.set({ experiment: table.text(row, "experiment_id") }), describe: (row) => this.#describe(row) });
    this.timePlot = new TimePlot(times);
  }

  #describe(row) {
    return this.table.text(row, "sentence") || `${this.table.text(row, "trigger")}: ${this.table.text(row, "ending").replaceAll("_", " ")}`;
  }

  #setReaction() {
    const seconds = Number(this.reaction.value);
    if (this.reaction.value === "" || !this.reaction.checkValidity()) this.reaction.reportValidity();
    else this.state.set({ plot: { ...this.state.plot, reaction: seconds === this.facts.reaction_s ? "" : String(seconds) } }, { replace: true });
  }

  /** Show what the state chooses; without a choice, the fault of the worst experiment and the margin that it falls below. */
  show() {
    if (!this.plot) return;
    const { table, state, faults, measures } = this, chosen = state.plot;
    const fault = faults.find(({ key }) => key === chosen.fault) ?? FaultValues.worstOf(table, faults);
    const measure = measures.find(({ name }) => name === chosen.y) ?? FaultValues.firstMeasure(table, fault, measures);
    const number = Number(chosen.reaction), reaction = chosen.reaction !== "" && number >= 0 && number <= 60 ? number : this.facts.reaction_s;
    const key = JSON.stringify([fault.key, measure.name, reaction]);
    if (key === this.drawn) return;
    this.drawn = key;
    this.faultPicker.value = fault.key;
    this.measurePicker.value = measure.name;
    this.reaction.value = String(reaction);
    const { points, inactive, unlimited } = FaultValues.pointsOf(table, fault, measure);
    const limits = measure.name === FaultValues.TIME ? [[reaction, `reaction time ${reaction} s`]] : measure.limits;
    this.caption.textContent = `${fault.name}: ${measure.about}`;
    this.plot.show(fault, measure, points, limits);
    this.counts.textContent = ValuePanel.#counted(measure, points, inactive, unlimited);
    this.timePlot.show({ all: this.times, of: FaultValues.timesOf(table, fault.rows), name: fault.name, reaction, hasRates: this.facts.has_rates });
  }

  static #counted(measure, points, inactive, unlimited) {
    const of = (count) => `${count} experiment${count === 1 ? "" : "s"}`;
    return [`${of(points.length)}, ${points.filter(({ isHazard }) => isHazard).length} with a hazard.`,
      inactive ? `${of(inactive)} in which the fault was never active: not drawn.` : "", unlimited ? `${of(unlimited)} without a finite ${measure.title}: not drawn.` : ""].filter(Boolean).join(" ");
  }

  /** The sentence about faults that have no single number as their value. */
  static #withoutValue(without) {
    const names = [...without.keys()].sort(), rest = names.length - ValuePanel.MOST_NAMES;
    if (!names.length) return "";
    const count = [...without.values()].reduce((a, b) => a + b, 0);
    return Dom.el("p.quiet", {}, `Not in the plots of values: ${count} experiment${count === 1 ? "" : "s"} whose fault has no single number as its value, such as noise or several values at once: `,
      names.slice(0, ValuePanel.MOST_NAMES).join(", "), rest > 0 ? ` and ${rest} more` : "", ".");
  }
}
