// @ts-check
"use strict";
// The replay of an opened experiment, and the choice of another one whose line lies over its plots.

class ReplayBeside {
  static MOST = 60; // experiments in a group of the choice

  /** `place` gets the replay of `series`, that of the experiment in a `row` of the table. */
  constructor(place, { table, row, state, facts }, series) {
    this.table = table;
    this.row = row;
    this.state = state;
    this.facts = facts;
    this.series = series;
    this.replay = Dom.el("div");
    this.note = Dom.el("span.quiet", { role: "status" });
    this.picker = Dom.el("select", { "aria-label": "Compare with", onchange: () => this.#choose(this.picker.value) });
    place.replaceChildren(Dom.el("div.row.beside-row", {}, Dom.el("label", {}, "Compare with: ", this.picker), this.note), this.replay);
  }

  /** Show the replay, with the experiment that the state names. */
  show() {
    this.#fill();
    this.#load(this.state.beside);
  }

  /** Titles and rows of the experiments that can be compared: those of the same fault in this scenario, then other faults with the same trigger, the worst
   *  first. Only one scenario and seed has one time axis and golden run.
   *  @returns {[string, number[]][]} */
  #groups() {
    const { table, row } = this, same = (other, ...names) => names.every((name) => table.text(other, name) === table.text(row, name));
    const rows = Array.from({ length: table.count }, (_, other) => other)
      .filter((other) => other !== row && table.text(other, "status") === "ok" && same(other, "scenario", "concrete_scenario", "seed")).sort((a, b) => table.number(a, "rank") - table.number(b, "rank"));
    const isSameFault = (other) => same(other, "kind", "variant");
    return [["Same fault, another value or trigger", rows.filter(isSameFault)], ["Another fault, same trigger", rows.filter((other) => !isSameFault(other) && same(other, "trigger"))]];
  }

  #name(row) {
    const { table } = this;
    return `${table.text(row, "fault")}, ${table.text(row, "trigger")}: ${table.text(row, "ending").replaceAll("_", " ")}`;
  }

  #fill() {
    const { el } = Dom, id = (row) => this.table.text(row, "experiment_id"), { MOST } = ReplayBeside, chosen = this.state.beside;
    const groups = this.#groups(), listed = groups.flatMap(([, rows]) => rows.slice(0, MOST)).map(id);
    const other = chosen && !listed.includes(chosen) ? this.table.find(chosen) : -1; // from a link
    const option = (row) => el("option", { value: id(row), selected: id(row) === chosen }, this.#name(row));
    this.picker.replaceChildren(el("option", { value: "" }, "no other experiment"), other >= 0 ? option(other) : "",
      ...groups.filter(([, rows]) => rows.length).map(([label, rows]) => el("optgroup", { label: rows.length > MOST ? `${label} (the worst ${MOST} of ${rows.length})` : label }, rows.slice(0, MOST).map(option))));
  }

  #choose(id) {
    this.state.set({ beside: id }, { replace: true });
    this.#load(id);
  }

  /** Show the replay with another line, at the same time and with the same plots as before. */
  #replay(beside) {
    const { player: before } = this, player = Replay.show(this.replay, this.series, this.facts, { beside });
    this.player = player;
    if (!before || !player) return;
    player.clock.seek(before.clock.t);
    player.plots.choose(before.plots.chosen);
    player.plots.cover(before.plots.view.from, before.plots.view.to);
    player.gauges.pressed();
  }

  async #load(id) {
    const row = id ? this.table.find(id) : -1;
    this.note.textContent = "";
    if (row < 0) {
      if (id) this.note.textContent = `No experiment of this page has the id ${id}.`;
      this.replay.dataset.beside = "";
      return this.#replay(null);
    }
    const details = await Details.read(), full = this.table.text(row, "experiment_id");
    const expected = { trace: details.trace(row), largest: Experiment.largestDeviations(this.table, row, this.facts) };
    const series = await SeriesFile.load(full, expected).catch((error) => error);
    if (this.state.beside !== id || !this.replay.isConnected) return; // another choice in the meantime
    const isReadable = series && !(series instanceof Error);
    if (!isReadable) this.note.textContent = series?.message ?? "There is no series of that experiment, so it cannot be drawn.";
    this.#replay(isReadable ? { name: this.#name(row), series } : null);
    this.replay.dataset.beside = isReadable ? full : "";
  }
}
