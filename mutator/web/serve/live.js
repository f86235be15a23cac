// @ts-check
"use strict";
// Watches a run: its stage, counts and worst results so far, until it is finished. Nothing is reloaded; each answer has only what changed.

(() => {
  const { el } = Dom;
  const page = document.getElementById("live");
  if (!page) return;
  const run = page.dataset.run, base = encodeURIComponent(run);
  const SOON_MS = 1000, LATER_MS = 5000, BEHIND_MS = 20;
  const STAGES = { plan: "planning", checks: "checks", golden: "golden runs", experiments: "experiments", proof: "proof", tables: "tables" };
  const COUNTED = ["checks", "golden", "proof"]; // stages whose steps are not experiments
  const stages = new Map(Object.entries(STAGES).map(([name, title]) => [name, el("li", {}, title)]));
  const rows = new Map(); // experiment and how it ended -> row
  const counters = new Map(); // name -> the element with the number
  const find = (id) => document.getElementById(id);
  const body = find("results").tBodies[0];
  let version = 0;

  const set = (element, text) => element.textContent !== text && (element.textContent = text);

  async function poll() {
    let pause = LATER_MS;
    try {
      const data = await Jobs.ask(`/api/runs/${base}/live?version=${version}`);
      show(data);
      if (data.report && !data.is_followed) return; // `mutator watch` puts the next run in the same place
      if (data.state === "running") pause = data.behind ? BEHIND_MS : SOON_MS;
    } catch (error) {
      set(find("state"), `No news: ${error.message}.`);
    }
    setTimeout(poll, pause);
  }

  function show(data) {
    set(find("campaign"), [data.campaign, data.target && `target ${data.target}`].filter(Boolean).join(", "));
    showStage(data);
    const link = find("report");
    link.hidden = !data.report;
    if (data.report) link.querySelector("a").href = data.report;
    if (data.hazards) showCounters(data);
    const share = data.planned ? data.done / data.planned : 0;
    find("bar").value = share;
    document.title = `${data.state === "running" && data.planned ? `${Math.floor(100 * share)} % ` : ""}${run} - mutator`;
    if (data.rows && data.version !== version) showRows(data.rows);
    version = data.version;
    set(find("provisional"), describeRows(data));
  }

  /** The stages, with the present one marked, and the state as a sentence. */
  function showStage({ state, stage, stage_done: steps, stage_total: total, detail, problem, harness_errors: errors }) {
    const names = [...stages.keys()], at = state === "finished" ? names.length : names.indexOf(stage);
    names.forEach((name, i) => {
      const item = stages.get(name);
      item.className = i < at ? "over" : i === at ? `now ${state}` : "";
      if (i === at && state === "running") item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
      set(item, i === at && COUNTED.includes(name) && total ? `${STAGES[name]} ${steps}/${total}` : STAGES[name]);
    });
    const status = find("state");
    status.className = state;
    set(status, {
      finished: "Finished.",
      running: `Running: ${STAGES[stage] ?? "starting"}${detail ? `, ${detail}` : ""}.`,
      failed: `Failed${stage ? ` in ${STAGES[stage]}` : ""}: ${problem}`,
      unfinished: `Not finished, and no command of this machine works on it${errors ? `; harness errors are retried` : ""}. The same \`mutator run\` resumes it.`,
    }[state] ?? state);
  }

  function showCounters(data) {
    const values = [["done", `${data.done} of ${data.planned}`], ["activated", data.activated],
      ...data.hazards.map(({ name, about, count }) => [name, count, about]), ...(data.silent === null ? [] : [["silent hazards", data.silent, "no alert before the hazard"]]),
      ...(data.harness_errors ? [["harness errors", data.harness_errors, "will be retried"]] : []),
      ["rate", data.rate || "–"], ["left in this stage", data.rest || "–"]];
    for (const [name, value, about] of values) {
      if (!counters.has(name)) {
        const number = el("dd");
        counters.set(name, number);
        find("counters").append(el("div", {}, el("dt", {}, name), number, about ? el("dd.about", {}, about) : null));
      }
      set(counters.get(name), String(value));
    }
  }

  function describeRows({ rows: newRows, done: count, state }) {
    const listed = newRows ? newRows.length : rows.size;
    if (!count) return state === "running" ? "No experiment has finished yet." : "No experiment has finished.";
    const which = listed < count ? `The ${listed} worst of ${count} results` : `All ${count} results`;
    return state === "finished" ? `${which}. The report has everything.` : `${which}, the worst first. They are provisional until the proof is complete.`;
  }

  /** Put the rows in order. A row stays the same element, so that its link keeps the focus. */
  function showRows(list) {
    find("results-scroll").hidden = list.length === 0;
    // in a run that takes this one's place, an experiment can end otherwise
    const keyOf = ({ id, ending, sentence }) => `${id} ${ending} ${sentence}`;
    const keys = new Set(list.map(keyOf));
    for (const [key, row] of rows) {
      if (keys.has(key)) continue;
      row.remove();
      rows.delete(key);
    }
    list.forEach((result, at) => {
      const key = keyOf(result);
      if (!rows.has(key)) rows.set(key, rowOf(result));
      const row = rows.get(key);
      set(row.cells[0], String(at + 1));
      if (body.children[at] !== row) body.insertBefore(row, body.children[at] || null);
    });
  }

  function rowOf({ id, ending, severity, hazards, fault, scenario, trigger, sentence }) {
    const about = [severity, hazards.join(", ")].filter(Boolean).join(", ");
    return el("tr", {}, el("td.number", {}), el("td", {}, el(`span.ending.${ending}`, {}, ending.replaceAll("_", " ")), about ? el("div.quiet", {}, about) : null),
      el("td", {}, el("a", { href: `/live/${base}/${id}` }, Dom.bound(sentence || fault))), el("td", {}, Dom.bound(fault)), el("td", {}, `${scenario}, ${trigger}`));
  }

  find("stages").append(...stages.values());
  poll();
})();
