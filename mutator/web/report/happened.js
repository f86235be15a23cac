// @ts-check
"use strict";
// What happened in an experiment: scenario, trigger, alert, events with their times, severity and metrics.

class Happened {
  /** The header's text after the outcome, for each value of `warning`. */
  static ALERTED = { "no alert at all": ", no alert at all,", "alert only after the hazard": ", no alert before it,", "alert before the hazard": " after an alert," };

  constructor(table, row, facts) {
    this.table = table;
    this.row = row;
    this.facts = facts;
  }

  get parts() {
    return [this.#setting(), this.#events()];
  }

  text(name) {
    return this.table.text(this.row, name);
  }

  /** Scenario, trigger and alerts in words. */
  #setting() {
    const { el } = Dom;
    const withMeaning = (name) => [this.text(name), this.table.meaning(name, this.text(name))].filter(Boolean).join(": ");
    const condition = this.text("condition"), trigger = withMeaning("trigger");
    const rows = [["scenario", [this.table.scenario(this.row), this.table.meaning("scenario", this.text("scenario"))].filter(Boolean).join(": ")], ["trigger", trigger.includes(condition) || trigger.startsWith("at ") ? trigger : `${condition} (${trigger})`]];
    if (this.text("status") === "ok" && this.table.columns.has("alerts")) rows.push(["alert", this.#alert()]);
    return el("table.plain.setting", {}, el("tbody", {}, rows.filter(([, about]) => about).map(([name, about]) =>
      el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, Dom.bound(about))))));
  }

  /** Whether there was an alert, and whether it came before the hazard. */
  #alert() {
    const first = this.text("alerts").split(";")[0], reaction = this.table.number(this.row, "reaction_time");
    if (!first) return this.text("hazards") ? "none at all (silent hazard)" : "none";
    if (!this.text("hazards")) return `${first}, without a hazard`;
    return Number.isNaN(reaction) ? `none before the hazard (silent hazard), ${first} only after it` : `${first}, ${reaction.toFixed(2)} s before the hazard`;
  }

  #events() {
    const { el } = Dom;
    const at = (name) => this.table.number(this.row, name), begin = at("t_activation");
    const count = this.text("activations") || "?", times = `${count} ${count === "1" ? "time" : "times"}`;
    const happened = [["t_activation", `fault first active (${times} in the whole run)`],
      ["t_manifest", "manifested: an actuator differs from the golden run"], ["t_alert", `first alert (all alerts: ${this.text("alerts").replaceAll(";", ", ")})`],
      ...this.table.checked.map((hazard) => [`t_${hazard.toLowerCase()}`, this.#hazard(hazard)]), ["t_end", "end of the drive: metrics ignore later steps"]]
      .map(([name, what]) => [at(name), what]).filter(([t]) => !Number.isNaN(t)).sort((a, b) => a[0] - b[0]);
    if (!happened.length) return el("p", {}, Happened.#nothing(this.text("status"), this.text("outcome")));
    const reaction = at("reaction_time");
    return el("div", {}, el("table.events", {}, el("thead", {}, el("tr", {}, ["time [s]", "from activation [s]", "what"].map((t) => el("th", { scope: "col" }, t)))),
      el("tbody", {}, happened.map(([t, what]) => el("tr", {}, el("td.time", {}, t.toFixed(2)),
        el("td.time", {}, Number.isNaN(begin) ? "" : `${t < begin ? "−" : "+"}${Math.abs(t - begin).toFixed(2)}`), el("td", {}, what))))),
      Number.isNaN(reaction) ? "" : el("p", {}, Dom.bound(`Reaction time (first alert to first hazard): ${reaction.toFixed(2)} s.`)),
      this.#severity(), this.#metrics());
  }

  /** The reason why there are no events. */
  static #nothing(status, outcome) {
    if (status === "invalid_mutant") return "The mutant could not be built. This says nothing about the fault.";
    if (status === "harness_error") return "The harness failed. This says nothing about the fault.";
    if (status === "left_out") return "It was left out, because its golden run has a hazard.";
    return outcome === "not_activated" ? "The fault was never active, so nothing happened." : "No event was recorded.";
  }

  /** A hazard with its meaning, if the manifest has one. */
  #hazard(name) {
    const about = (this.facts.hazards || []).find((hazard) => hazard.name === name)?.about;
    return `hazard ${name}${about ? `: ${about}` : ""}`;
  }

  /** The severity class of the worst hazard, the values that it follows from, and its meaning. */
  #severity() {
    const { el } = Dom;
    const name = this.text("severity"), scale = this.facts.severity;
    const reason = this.text("no_severity");
    if (reason) return el("p", {}, `No severity class: ${reason}.`);
    if (!name || !scale) return "";
    const hazard = this.text("severity_hazard"), rule = (scale.rules || []).find((of) => of.hazard === hazard);
    const metric = (of, unit) => `${of.replaceAll("_", " ")} ${Happened.#measured(this.table.number(this.row, of))} ${unit}`;
    const values = rule ? rule.metrics.map((of, i) => metric(of, rule.units[i][1])).join(", ") : metric("delta_v", "m/s").replace("delta v", "delta-v");
    const called = this.table.called("severity", name), about = (rule || scale).classes.find(([of]) => of === name)?.[2];
    return el("div", {}, el("b", {}, called[0].toUpperCase() + called.slice(1)), Dom.bound(`${rule ? `, of ${hazard}` : ""}: ${values}`),
      about ? Dom.bound(`, ${about}`) : "", el("details.quiet", {}, el("summary", {}, "Source of the classes"), Happened.#source(rule, scale)));
  }

  /** A measured number as in the sentence: with hundredths; one below 0.1 with two digits. */
  static #measured(number) {
    return Math.abs(number) >= 0.1 ? number.toFixed(2) : String(Number(number.toPrecision(2)));
  }

  /** The source of a rule's bounds, or of those of delta-v; a judgement is called one. */
  static #source(rule, scale) {
    if (!rule) return `${scale.name}: ${scale.source}`;
    const judgement = rule.judgement ? `judgement: ${rule.judgement}` : "";
    return `${scale.name}, ${rule.name}: ${[rule.about, rule.source, judgement].filter(Boolean).join(" ")}`;
  }

  /** The metrics of this run and their meanings. */
  #metrics() {
    const { el } = Dom;
    const metrics = (this.facts.metrics || []).filter(([name]) => this.text(name) !== "");
    if (!metrics.length) return "";
    return el("details", {}, el("summary", {}, `Metrics (${metrics.length})`), el("div.scroll", { tabindex: 0 }, el("table.plain", {}, el("tbody", {},
      metrics.map(([name, unit, about]) => el("tr", {}, el("th", { scope: "row" }, name.replaceAll("_", " ")),
        el("td.number", {}, Grid.number(this.table.number(this.row, name))), el("td", {}, unit), el("td", {}, about)))))));
  }
}
