// @ts-check
"use strict";
// The first page's list of runs: states and counts of runs that change, and the choice of two runs to compare.

(() => {
  const { el } = Dom;
  const rows = new Map([...document.querySelectorAll("tr[data-run]")].map((row) => [row.dataset.run, row]));
  let isAsking = false;

  /** Show what has changed. A run that is new comes first when the page is opened again. */
  async function update() {
    if (isAsking) return;
    isAsking = true;
    const { runs } = await Jobs.ask("/api/runs").catch(() => ({ runs: [] }));
    isAsking = false;
    for (const run of runs) {
      const row = rows.get(run.key);
      if (!row) continue;
      const text = [run.state, run.stage, run.problem].filter(Boolean).join(": "), progress = `${run.done} of ${run.planned}`;
      const [state, count] = [row.querySelector(".state"), row.querySelector(".done")];
      if (state.textContent === text && count.textContent === progress) continue;
      state.textContent = text;
      count.textContent = progress;
      row.querySelector("a").href = ["running", "failed"].includes(run.state) ? run.live : run.report;
      row.querySelector(".outcomes").replaceChildren(...Object.entries(run.outcomes).filter(([, n]) => n)
        .flatMap(([name, n]) => [el(`span.ending.${name}`, {}, `${n} ${name.replaceAll("_", " ")}`), " "]));
    }
  }

  const form = document.querySelector("#compare form");
  form?.addEventListener("submit", (event) => {
    event.preventDefault();
    const chosen = new FormData(form), part = (name) => encodeURIComponent(String(chosen.get(name)));
    location.assign(`/compare/${part("a")}/${part("b")}/`);
  });
  if (rows.size) Jobs.watch(update);
})();
