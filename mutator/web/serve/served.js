// @ts-check
"use strict";
// Buttons on an experiment of a served report for actions that would otherwise need a shell.

(() => {
  const { el } = Dom;
  const place = document.getElementById("experiment");
  const [, kind, key] = location.pathname.split("/");
  if (!place || kind !== "runs") return;
  const run = decodeURIComponent(key);
  const facts = JSON.parse(document.getElementById("facts").textContent);
  let shownId = null; // id of the experiment with buttons

  /** The default time of a still: that of an event. */
  function momentOf(experiment) {
    const at = (name) => experiment.table.number(experiment.row, name);
    const time = ["t_hazard", "t_manifest", "t_activation"].map(at).find((t) => !Number.isNaN(t));
    return (time ?? 10).toFixed(2);
  }

  function buttons(id, experiment) {
    const status = el("p.said", { role: "status" }), jobs = el("ul.own-jobs");
    const order = async (order) => {
      status.textContent = "…";
      try {
        await Jobs.start({ ...order, run, experiment: id });
        status.textContent = "";
      } catch (error) {
        status.textContent = `Not started: ${error.message}.`;
      }
    };
    const button = (text, title, ask) => el("button", { type: "button", title, onclick: () => order(ask()) }, text);
    const time = el("input", { type: "number", min: 0, step: "0.05", value: momentOf(experiment), "aria-label": "Time of the still, in seconds" });
    const pictures = facts.filmed ? [button("Film", "Golden and faulty runs, the whole drive", () => ({ kind: "film" })),
      el("span.still", {}, button("Still", "One image of the golden and faulty runs", () => ({ kind: "still", t: Number(time.value) })), " at ", time, " s")] : [];
    const hasHazard = experiment.table.text(experiment.row, "outcome") === "hazard";
    const shrink = hasHazard ? button("Shrink", "Find the smallest fault with the same hazard: some 20 runs", () => ({ kind: "shrink" })) : null;
    const section = el("section.do", { "data-id": id }, el("h3", {}, "Run it here"),
      el("div.row", {}, button("Rerun", "Check that the result is the same", () => ({ kind: "rerun" })),
        button("Exact plot", "Rerun and record every step of the channels", () => ({ kind: "plot" })), shrink, pictures),
      status, jobs);
    plot(id, section);
    return section;
  }

  /** The exact plot, if it exists. */
  async function plot(id, place) {
    const link = (await Packed.read("media"))?.[id]?.plot;
    if (!link) return;
    place.append(el("figure.drawing", {}, el("a", { href: link }, el("img", { src: link, alt: "Channels of golden and faulty over time" })),
      el("figcaption.quiet", {}, "Exact plot: every step of golden and faulty")));
  }

  function fill({ id, experiment }) {
    if (place.querySelector(`section.do[data-id="${id}"]`)) return;
    shownId = id;
    place.querySelector("section.again").before(buttons(id, experiment));
    Jobs.watch(showJobs);
  }

  /** The jobs of the open experiment. */
  function showJobs(jobs) {
    const list = place.querySelector(".own-jobs");
    if (!list) return;
    const mine = jobs.filter((job) => job.run === run && job.experiment === shownId).slice(0, 3);
    const text = JSON.stringify(mine.map((job) => [job.id, job.state, job.message]));
    if (list.dataset.text === text) return;
    list.dataset.text = text;
    list.replaceChildren(...mine.map((job) => el("li", {}, el(`span.job-state.${job.state}`, {}, job.state), ` ${job.title}: ${job.message} `,
      job.state === "done" ? resultControl(job) : null)));
  }

  /** The control that shows the result of a job: that of shrinking is an experiment of another run. */
  const resultControl = (job) => (job.kind === "shrink" && job.result
    ? el("a", { href: job.result }, "Show it")
    : el("button", { type: "button", onclick: () => location.reload() }, "Show it"));

  place.addEventListener("filled", (event) => fill(event.detail));
  if (Experiment.open) fill(Experiment.open);
})();
