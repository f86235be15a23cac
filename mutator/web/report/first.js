// @ts-check
"use strict";
// The replay of the worst experiment on the first screen. It is built once the page is usable, in idle time, and only if it is in
// view. It starts by itself once it is visible, unless the reader wants less motion, and pauses when it is no longer visible.

class FirstScreen {
  static VISIBLE = 0.6; // share of the replay that must be visible
  static PATIENCE = 1000; // ms that a busy page can delay the replay

  constructor(place, table, facts) {
    this.place = place;
    this.table = table;
    this.facts = facts;
    this.player = null; // null until it is shown, and without channels
    this.wasStarted = false;
    this.isFilled = false;
    this.watch = new IntersectionObserver(([entry]) => entry.isIntersecting && this.#showWhenIdle());
    this.watch.observe(place);
  }

  #showWhenIdle() {
    const whenIdle = window.requestIdleCallback ?? ((todo) => setTimeout(todo)); // Safari has none
    whenIdle(() => {
      if (this.isFilled || !this.place.getClientRects().length) return; // an experiment was opened in the meantime
      this.isFilled = true;
      this.watch.disconnect();
      this.#fill();
    }, { timeout: FirstScreen.PATIENCE });
  }

  async #fill() {
    const { el } = Dom, { id, trace } = this.facts.worst, row = this.#row(id);
    const series = await SeriesFile.load(id, { trace, largest: Experiment.largestDeviations(this.table, row, this.facts) }).catch((error) => error);
    if (series instanceof Error) this.place.replaceChildren(el("p", { role: "alert" }, series.message));
    else if (!series) this.place.replaceChildren(el("p.quiet", {}, this.#reason(row)));
    else this.player = Replay.show(this.place, series, { ...this.facts, title: "Replay of the worst experiment" }, { isBrief: true });
    if (this.player) new IntersectionObserver(([entry]) => this.#playIfVisible(entry.isIntersecting), { threshold: FirstScreen.VISIBLE }).observe(this.place);
  }

  /** The row of the worst experiment, without an index of all ids. */
  #row(id) {
    return this.table.columns.get("experiment_id").texts.indexOf(id);
  }

  /** Why there is no replay. */
  #reason(row) {
    return Experiment.ENDINGS[this.table.text(row, "status")] ? `${Experiment.ENDINGS[this.table.text(row, "status")]}, so there are no channels.`
      : this.facts.series.reason_if_missing;
  }

  #playIfVisible(isVisible) {
    const { clock } = this.player;
    if (!isVisible) clock.pause();
    else if (!this.wasStarted && !clock.calm.matches) {
      this.wasStarted = true;
      clock.play();
    }
  }
}
