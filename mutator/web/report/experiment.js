// @ts-check
"use strict";
// An open experiment next to the list: events, path, replay, diff, and commands to run it again.

class Experiment {
  static ENDINGS = { // why an experiment has no channels, by its status
    crashed: "The run crashed", timeout: "The run did not end in time", invalid_mutant: "The mutant could not be built", harness_error: "The harness failed", left_out: "The experiment was left out",
  };

  static open = null; // {id, experiment} for scripts that add buttons; the event `filled` notifies them

  /** `actions`: `move(by)` moves within the list, `place()` returns the position in the list, `close()` closes the panel. */
  constructor(place, table, state, facts, actions) {
    this.place = place;
    this.table = table;
    this.state = state;
    this.facts = facts;
    this.actions = actions;
    this.title = document.title;
    this.mode = innerWidth > 1100 ? "split" : "unified";
    this.row = -1;
  }

  get isOpen() {
    return !this.place.hidden;
  }

  /** Show the experiment that the state names, or hide the panel. */
  async show() {
    const id = this.state.experiment, row = id ? this.table.find(id) : -1;
    if (!id) {
      Experiment.open = null;
      this.place.hidden = true;
      this.place.replaceChildren(); // stops its replay
      this.row = -1;
      document.title = this.title;
      return;
    }
    if (row >= 0 && row === this.row && this.isOpen) {
      this.#showPlace(); // the filters might have changed the list
      return;
    }
    const wasOpen = this.isOpen, hadFocus = this.place.contains(document.activeElement);
    const button = document.activeElement?.getAttribute("aria-label"); // users press next and previous repeatedly
    this.row = row;
    this.place.hidden = false;
    if (row < 0) this.#none(id);
    else this.#fill();
    this.#showPlace();
    this.place.scrollTop = 0;
    // restore the lost focus; otherwise keys would scroll the page below
    if (!wasOpen || hadFocus) {
      const same = hadFocus && [...this.place.querySelectorAll("header button")].find((b) => b.getAttribute("aria-label") === button);
      (same || this.place.querySelector("h2")).focus({ preventScroll: true });
    }
    if (row >= 0) await this.#fillLate(row);
  }

  text(name) {
    return this.table.text(this.row, name);
  }

  get #endedWell() {
    return this.text("status") === "ok";
  }

  /** The buttons beside the title. A page that shows one experiment alone has others. */
  buttons() {
    const { el } = Dom;
    const button = (text, name, todo) => el("button", { type: "button", "aria-label": name, title: name, onclick: todo }, text);
    return el("div.buttons", {}, el("span.place.quiet"),
      button("↑", "Previous experiment (k)", () => this.actions.move(-1)),
      button("↓", "Next experiment (j)", () => this.actions.move(1)),
      button("Close", "Close (Esc)", () => this.actions.close()));
  }

  #showPlace() {
    this.place.querySelector(".place").textContent = this.actions.place();
  }

  #none(id) {
    const { el } = Dom;
    document.title = this.title;
    this.place.replaceChildren(el("header", {}, el("h2", { tabindex: -1, id: "experiment-title" }, "No such experiment"), this.buttons()),
      el("p", {}, "No experiment in this report has an id that begins with ", el("code", {}, id), "."));
  }

  #fill() {
    const { el } = Dom;
    const id = this.text("experiment_id");
    document.title = `${this.text("fault")} in ${this.table.scenario(this.row)} - ${this.title}`;
    const code = (name) => el("span", { title: this.table.meaning(name, this.text(name)) }, this.text(name));
    const section = (title, name) => el(`section.${name}`, {}, el("h3", {}, title), el("div.content", {}, el("p.quiet", {}, "…")));
    this.place.replaceChildren(
      el("header", {},
        el("div", {}, el("h2", { tabindex: -1, id: "experiment-title" }, Dom.bound(this.text("sentence") || this.text("fault"))),
          el("p.under", {}, el("span.fault", {}, this.text("fault")), ": ", Grid.ending(this.text("ending")), Happened.ALERTED[this.text("warning")] ?? "", " in ", this.scenario(), ", trigger ", code("trigger"))),
        this.buttons()),
      el("p.id", {}, "experiment ", el("code", {}, id), " ", Dom.copyButton(() => id, "Copy id"), " ", Dom.copyButton(() => this.#link(), "Copy link")),
      this.text("detail") ? el("p.detail", {}, Dom.bound(this.text("detail"))) : "",
      el("section.happened", {}, el("h3", {}, "What happened"), new Happened(this.table, this.row, this.facts).parts),
      typeof Path === "undefined" ? "" : section("Path of the fault", "path"),
      section("Replay", "replay"),
      section("Pictures", "pictures"),
      section("Diff", "change"),
      section("Injected lines", "snippet"),
      section("Fault spec with this experiment's value", "spec"),
      el("section.again", {}, el("h3", {}, "Run it again"), this.commands()),
      el("details", {}, el("summary", {}, "All results"), this.#results()));
    Experiment.open = { id, experiment: this };
    this.place.dispatchEvent(new CustomEvent("filled", { detail: Experiment.open }));
  }

  #link() {
    return `${location.href.split("#")[0]}#e=${this.text("experiment_id")}`;
  }

  command(text) {
    const { el } = Dom;
    return el("div.command", {}, el("code", { tabindex: 0 }, text), Dom.copyButton(() => text));
  }

  /** How to run the experiment again. */
  commands() {
    const { el } = Dom;
    const id = this.text("experiment_id"), run = this.facts.run();
    const tried = this.text("module") === "operators" ? [] // an operator's fault has no spec
      : [el("p", {}, "Try a variation: change the value, trigger or scenario in this command:"), this.command(this.tryCommand())];
    return el("div", {}, el("p", {}, "These commands rerun the experiment and compare it with its record, and show its diff, times and plot:"),
      this.command(`mutator rerun ${id} --run ${run}`), this.command(`mutator show ${id} --run ${run}`), tried);
  }

  /** The scenario, with its meaning; of a family, with its values. */
  scenario() {
    return Dom.el("span", { title: this.table.meaning("scenario", this.text("scenario")) }, Dom.bound(this.table.scenario(this.row)));
  }

  /** The `mutator try` command for this fault. A random trigger becomes a time. The reading is always named, because
   *  the default depends on the library. */
  tryCommand() {
    const value = this.text("value"), isNumber = value !== "" && !Number.isNaN(Number(value));
    const quoted = (text) => (/^[\w./:=,-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
    const when = /^\w+$/.test(this.text("trigger")) ? this.text("trigger") : this.text("condition").replace(/^t >= ([\d.]+)$/, "$1");
    const parts = ["mutator try", quoted(this.text("kind")), "--scenario", quoted(this.table.scenarioArgument(this.row))];
    if (this.text("variant")) parts.push("--variant", quoted(this.text("variant")));
    if (isNumber) parts.push("--value", value);
    if (when) parts.push("--trigger", quoted(when));
    if (this.text("reading")) parts.push("--reading", quoted(this.text("reading")));
    return parts.join(" ");
  }

  #results() {
    const { el } = Dom;
    return el("div.scroll", {}, el("table", {}, el("tbody", {}, [...this.table.columns.keys()].map((name) =>
      el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, this.text(name)))))));
  }

  #content(name) {
    return this.place.querySelector(`section.${name} .content`);
  }

  // What an experiment is shown from; a page that shows one alone has other sources.
  details = () => Details.read();
  media = () => Packed.read("media");
  series = (id, expected) => SeriesFile.load(id, expected);

  /** Show the replay, with a choice of another experiment to lay over it. */
  showReplay(place, row, series) {
    new ReplayBeside(place, { table: this.table, row, state: this.state, facts: this.facts }, series).show();
  }

  /** Fill the parts that are unpacked on first use: diff, spec, stills and series. */
  async #fillLate(row) {
    const id = this.text("experiment_id");
    this.#path();
    const details = await this.details(), expected = { trace: details.trace(row), largest: Experiment.largestDeviations(this.table, row, this.facts) };
    const [media, series] = await Promise.all([this.media(), this.series(id, expected).catch((error) => error)]);
    if (this.row !== row) return; // another experiment was opened in the meantime
    this.#change(details.patch(row));
    const spec = details.spec(row);
    this.#content("spec").replaceChildren(spec ? this.#spec(spec, details.setting(row)) : Dom.el("p.quiet", {}, "The plan of this run folder does not contain this experiment."));
    this.#pictures(id, [media?.[id]].find((pictures) => pictures?.stills.length || pictures?.films.length));
    const place = this.#content("replay");
    if (series && !(series instanceof Error)) this.showReplay(place, row, series);
    else this.#noSeries(id, expected, series);
  }

  /** The largest deviation of each compared channel in the whole run of a row, if the run ended normally. */
  static largestDeviations(table, row, facts) {
    const columns = Object.entries(facts.series.deviations).map(([name, column]) => [name, table.number(row, column)]);
    return Object.fromEntries(columns.filter(([, by]) => !Number.isNaN(by)));
  }

  /** Show how far the fault got. `Path` reads this experiment's results with `text(name)` and `number(name)`. */
  #path() {
    if (typeof Path === "undefined") return;
    const { table, row } = this;
    const results = { row, text: (name) => table.text(row, name), number: (name) => table.number(row, name) };
    Path.strip(this.#content("path"), results);
  }

  #change(patch) {
    const { el } = Dom;
    const place = this.#content("change"), snippet = this.#content("snippet");
    if (patch === null) {
      place.replaceChildren(el("p.quiet", {}, "There is no diff: the experiment has not run, or its mutant could not be built."));
      snippet.parentElement.remove();
      return;
    }
    const diff = el("div");
    const button = (mode, title) => el("button", { type: "button", "aria-pressed": String(this.mode === mode), onclick: () => {
      this.mode = mode;
      this.#change(patch);
      this.#content("change").querySelector('[aria-pressed="true"]').focus();
    } }, title);
    place.replaceChildren(el("div.buttons", { role: "group", "aria-label": "Diff layout" },
      button("unified", "Unified"), button("split", "Side by side"), Dom.copyButton(() => patch, "Copy diff")), diff,
      el("p.quiet", {}, "Not shown: the probe, the module that evaluates the mutant's trigger."));
    renderDiff(diff, patch, { mode: this.mode });
    const lines = Diff.injected(patch);
    snippet.replaceChildren(...lines.map(({ path, lines: code }) => el("div", {}, el("p.quiet", {}, path),
      el("pre", { tabindex: 0 }, el("code", {}, dedented(code).map((line) => [...Diff.coloured(line), "\n"]))))));
  }

  #spec(spec, setting) {
    const { el } = Dom;
    const rows = [["trigger", this.text("condition")], ["hold", setting.hold + (setting.hold_s === null ? "" : ` ${setting.hold_s} s`)],
      ["armed after", `${setting.armed_after_s} s`], ["scenario changes", setting.changes.join(", ") || "none"], ["seed", this.text("seed")]];
    return el("div", {}, el("pre", { tabindex: 0 }, el("code", {}, spec)),
      el("table", {}, el("tbody", {}, rows.map(([name, value]) => el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, value))))));
  }

  #pictures(id, pictures) {
    const { el } = Dom;
    const place = this.#content("pictures");
    if (!pictures && !(this.facts.filmed && this.#endedWell)) {
      place.parentElement.remove(); // the target cannot be filmed, or the run has no channels
      return;
    }
    const hazard = this.table.number(this.row, "t_hazard"), begin = this.table.number(this.row, "t_activation");
    const t = Number.isNaN(hazard) ? (Number.isNaN(begin) ? 10 : begin + 2) : hazard;
    place.replaceChildren(
      ...(pictures ? pictures.stills : []).map(([time, link]) => el("figure", {}, el("img", { src: link, alt: `Golden and faulty runs at ${time} s`, loading: "lazy" }), el("figcaption", {}, this.#moment(time)))),
      ...(pictures ? pictures.films : []).map((link) => link.endsWith(".gif") ? el("img", { src: link, alt: "Golden and faulty runs", loading: "lazy" })
        : el("video", { src: link, controls: true, preload: "none", "aria-label": "Golden and faulty runs" })),
      ...(this.facts.series.alone ? [] : this.#filming(id, pictures, t)));
  }

  /** Commands that make pictures in the run folder. */
  #filming(id, pictures, t) {
    const { el } = Dom, run = this.facts.run(), separator = run.includes("\\") ? "\\" : "/";
    return [
      el("p", {}, pictures ? "More stills, or a film:" : "There are no pictures of this experiment yet. This command makes a still and a film:"),
      this.command(`mutator show ${id} --run ${run} --still ${t.toFixed(2)} --video ${run}${separator}plots${separator}${id}.mp4`),
      el("p", {}, "Then rebuild the report to see them here:"), this.command(`mutator report ${run}`)];
  }

  /** The time of a still, as in its file name, and the event at that time. */
  #moment(time) {
    const moments = { t_activation: "fault first active", t_alert: "first alert", t_hazard: "first hazard" };
    const what = Object.keys(moments).filter((name) => this.table.number(this.row, name).toFixed(2) === time).map((name) => moments[name]);
    return `${[`${time} s`, ...what].join(", ")} (the nearest still)`;
  }

  /** The reason why there is no replay, and how to get one. `error` says why an existing series cannot be read. */
  #noSeries(id, expected, error) {
    const { el } = Dom;
    const place = this.#content("replay");
    if (!this.#endedWell) {
      place.replaceChildren(el("p", {}, `${Experiment.ENDINGS[this.text("status")] ?? "The run did not finish normally"}, so there are no channels.`));
      return;
    }
    const { alone, reason_if_missing: reason } = this.facts.series; // alone: the page cannot load files
    if (alone) {
      const isBeyond = this.table.number(this.row, "rank") > alone.last_rank, isUnreadable = error || alone.unreadable.includes(id);
      place.replaceChildren(isUnreadable ? el("p", { role: "alert" }, error?.message ?? "The run folder has a series of this experiment, but it is damaged or belongs to another run than the record.")
        : el("p", {}, isBeyond ? alone.reason_beyond : reason));
      return;
    }
    const status = el("p", { role: "status" });
    const load = async () => {
      const series = await SeriesFile.load(id, expected, { isNew: true }).catch((error) => error);
      if (this.text("experiment_id") !== id) return;
      if (!series || series instanceof Error) status.textContent = series ? series.message : "The series does not exist yet.";
      else Replay.show(place, series, this.facts);
    };
    const isApart = error?.cause?.isMissingFile;
    const why = isApart ? "The channels are not next to this page: it lies outside its run folder, or the folder's `series` was removed. Open report/index.html in the whole run folder."
      : reason;
    place.replaceChildren(error && !isApart ? el("p", { role: "alert" }, error.message) : el("p", {}, why), el("p", {}, "This command reruns it:"),
      this.command(`mutator rerun ${id} --trace --run ${this.facts.run()}`),
      el("p", {}, el("button", { type: "button", onclick: load }, "Show them"), " after the rerun."), status);
  }
}

/** Lines without their common indentation. */
function dedented(lines) {
  const depth = Math.min(...lines.filter((l) => l.trim()).map((l) => l.length - l.trimStart().length));
  return lines.map((line) => line.slice(depth));
}
