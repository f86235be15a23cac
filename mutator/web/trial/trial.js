// @ts-check
"use strict";
// One experiment alone, in the view that a report has: a trial, whose value can be varied, or an experiment of a run that still works.

/** An experiment whose data the server sent as one object. */
class LoneExperiment extends Experiment {
  static TITLE = "mutator";

  constructor(place, data) {
    const table = new Rows.Table(data.table, data.facts.meanings);
    super(place, table, { experiment: data.id }, { ...data.facts, run: () => "DIR" }, { move: () => {}, place: () => "", close: () => {} });
    this.data = data;
    this.title = LoneExperiment.TITLE;
  }

  buttons() {
    return Dom.el("div.buttons", {}, Dom.el("span.place"));
  }

  commands() {
    const { el } = Dom;
    return el("div", {}, el("p", {}, "This command tries the fault in a terminal:"), this.command(this.tryCommand()));
  }

  details = async () => new Details(this.data.details);
  media = async () => null;
  series = (id, expected) => SeriesFile.load(id, expected, { texts: this.data.series });

  showReplay(place, _, series) {
    Replay.show(place, series, this.facts);
  }
}

(() => {
  const page = document.getElementById("trial"), place = document.getElementById("experiment"), status = document.getElementById("said");
  const vary = document.getElementById("vary");
  let turn = 0; // of the newest value; answers for older ones are ignored
  let job = null; // id of the job that drives the newest value
  let data = null, slider = null;

  function tell(text, isBad = false) {
    status.className = isBad ? "bad" : "";
    if (status.textContent !== text) status.textContent = text;
  }

  async function load(address) {
    const loaded = await Jobs.ask(address);
    data = loaded;
    document.getElementById("trial-title").textContent = data.request ? "Trial" : "Experiment of a run that is not finished";
    if (data.request && !slider) offerSlider();
    slider?.set(data.request.value);
    await new LoneExperiment(place, data).show();
    if (!data.request) tell(data.finished ? "The run is finished; its report has this experiment, too." : "Provisional: the run is not finished.");
    place.dataset.experiment = data.id;
  }

  /** Show the slider, or say why there is none. */
  function offerSlider() {
    vary.hidden = false;
    if (data.range && data.range.low < data.range.high) slider = new Slider(vary, data.range, drive);
    else vary.replaceChildren(Dom.el("p.quiet", { id: "vary-head" }, data.range ? "The spec declares a single value, so there is nothing to vary." : "This fault has no value to vary."));
  }

  /** Drive another value. Only the newest one counts: the job of an older one is cancelled. */
  async function drive(value) {
    const mine = ++turn, older = job;
    job = null;
    tell(`Driving with ${value} …`);
    try {
      if (older) await cancel(older);
      if (mine !== turn) return;
      const id = await Jobs.start({ ...data.request, value });
      if (mine === turn) job = id;
      else await cancel(id);
    } catch (error) {
      if (mine === turn) tell(`Not started: ${error.message}.`, true);
    }
  }

  /** Cancel a job that may have ended. */
  const cancel = (id) => Jobs.ask(`/api/jobs/${id}/cancel`, {}).catch(() => null);

  async function follow(jobs) {
    const mine = turn, driven = jobs.find(({ id }) => id === job);
    if (!driven) return;
    if (driven.state === "queued") tell("Waits for another job …");
    if (driven.state === "running") tell(`Driving: ${driven.message || "starting"} …`);
    if (!["done", "failed", "cancelled"].includes(driven.state)) return;
    job = null;
    if (driven.state !== "done" || !driven.result) return tell(`${driven.state === "cancelled" ? "Cancelled" : "Failed"}: ${driven.message}`, true);
    try {
      await load(`/api/trials/${driven.result.split("/").pop()}`);
      if (mine !== turn) return;
      history.replaceState(null, "", driven.result);
      tell("");
    } catch (error) {
      tell(`The trial cannot be shown: ${error.message}.`, true);
    }
  }

  load(page.dataset.address).then(() => data.request && tell(""), (error) => tell(`This experiment cannot be shown: ${error.message}.`, true));
  Jobs.watch(follow);
})();
