"use strict";
// An experiment of a served report: what else would need a shell, as buttons.

(() => {
  const { el } = Dom;
  const place = document.getElementById("experiment");
  const [, kind, key] = location.pathname.split("/");
  if (!place || kind !== "runs") return;
  const run = decodeURIComponent(key);
  const facts = JSON.parse(document.getElementById("facts").textContent);
  let shown = null; // the id of the experiment that has its buttons

  /** The time that a still is of, unless another is given: where something happened. */
  function momentOf(experiment) {
    const at = (name) => experiment.table.number(experiment.row, name);
    const found = ["t_hazard", "t_manifest", "t_activation"].map(at).find((t) => !Number.isNaN(t));
    return (found ?? 10).toFixed(2);
  }

  function buttons(id, experiment) {
    const said = el("p.said", { role: "status" }), jobs = el("ul.own-jobs");
    const order = async (order) => {
      said.textContent = "…";
      try {
        await Jobs.start({ ...order, run, experiment: id });
        said.textContent = "";
      } catch (error) {
        said.textContent = `Not started: ${error.message}.`;
      }
    };
    const button = (text, title, ask) => el("button", { type: "button", title, onclick: () => order(ask()) }, text);
    const time = el("input", { type: "number", min: 0, step: "0.05", value: momentOf(experiment), "aria-label": "Time of the still, in seconds" });
    const pictures = facts.filmed ? [button("Film", "Golden beside faulty, the whole drive", () => ({ kind: "film" })),
      el("span.still", {}, button("Still", "A picture of that film", () => ({ kind: "still", t: Number(time.value) })), " at ", time, " s")] : [];
    const made = el("section.do", { "data-id": id }, el("h3", {}, "Run it here"),
      el("div.row", {}, button("Drive again", "Is the result the same?", () => ({ kind: "rerun" })),
        button("Exact plot", "Drive it again and keep every step of its channels", () => ({ kind: "plot" })), pictures),
      said, jobs);
    plot(id, made);
    return made;
  }

  /** The exact plot, if it has been drawn. */
  async function plot(id, place) {
    const link = (await Packed.read("media"))?.[id]?.plot;
    if (!link) return;
    place.append(el("figure.drawing", {}, el("a", { href: link }, el("img", { src: link, alt: "Channels of golden and faulty over time" })),
      el("figcaption.quiet", {}, "Exact plot: every step of golden and faulty")));
  }

  function fill({ id, experiment }) {
    if (place.querySelector(`section.do[data-id="${id}"]`)) return;
    shown = id;
    place.querySelector("section.again").before(buttons(id, experiment));
    Jobs.watch(own);
  }

  /** What was asked for of the open experiment. */
  function own(jobs) {
    const list = place.querySelector(".own-jobs");
    if (!list) return;
    const mine = jobs.filter((job) => job.run === run && job.experiment === shown).slice(0, 3);
    const text = JSON.stringify(mine.map((job) => [job.id, job.state, job.message]));
    if (list.dataset.text === text) return;
    list.dataset.text = text;
    list.replaceChildren(...mine.map((job) => el("li", {}, el(`span.job-state.${job.state}`, {}, job.state), ` ${job.title}: ${job.message} `,
      job.state === "done" ? el("button", { type: "button", onclick: () => location.reload() }, "Show it") : null)));
  }

  place.addEventListener("filled", (event) => fill(event.detail));
  if (Experiment.open) fill(Experiment.open);
})();
