// @ts-check
"use strict";
// What became of each experiment with each set of defences: a column of the list, a filter, and a part of the opened experiment.
// Only reports of runs with such sets load it, before the page starts.

const Defences = (() => {
  const ALL = "with_defences"; // the column with all sets
  const MARKS = { prevented: "P", open: "O", replaced: "R", mitigated: "M", unchanged: "U", worsened: "W", caused: "C", "no hazard": "·", "not compared": "?" };
  const MARK_PX = 23, LEAST_PX = 118;
  const { defences: { sets, outcomes }, series } = JSON.parse(document.getElementById("facts").textContent);

  /** The outcome without its hazards: `caused` for `caused H4`; '' without a result. */
  function outcomeOf(text) {
    return Object.keys(MARKS).find((outcome) => text.startsWith(outcome)) ?? "";
  }

  /** What became of the experiment of a row with a set, as a mark or in words. */
  function fate(table, row, { name, column }, isMark) {
    const text = table.text(row, column), outcome = outcomeOf(text);
    const title = `${isMark ? `${name}: ` : ""}${text}${outcomes[outcome] ? ` (${outcomes[outcome]})` : ""}`;
    return Dom.el(`span.fate.${outcome.split(" ").pop() || "none"}`, { title }, isMark ? MARKS[outcome] ?? "" : text);
  }

  const listed = {
    name: ALL, title: "with defences", px: Math.max(LEAST_PX, 14 + MARK_PX * sets.length),
    about: `A mark for each set, in this order: ${sets.map(({ name }) => name).join(", ")}. ${Object.entries(MARKS).map(([outcome, mark]) => `${mark} ${outcome}`).join(", ")}.`,
    cell: (table, row) => Dom.el("span.fates", {}, sets.map((set) => fate(table, row, set, true))),
  };
  document.querySelector(".under-list").append(` Column "with defences": ${listed.about}`);
  Grid.COLUMNS.splice(Grid.COLUMNS.findIndex(({ name }) => name === "ending") + 1, 0, listed);
  Rows.FACETS.push({ name: ALL, title: "With defences", between: ";", none: "no set" });

  /** The part of an opened experiment: each set with what became of it, what acted, and a link to both drives. */
  function part({ table, row }, details) {
    const { el } = Dom, id = table.text(row, "experiment_id");
    const link = (set, number) => (series.alone || !details[number].changed.includes(row) ? "" : el("a", { href: `${set.page}#q=${id}` }, "both drives"));
    return el("section.defended", {}, el("h3", {}, "With defences"), el("div.scroll", {}, el("table.plain", {},
      el("thead", {}, el("tr", {}, ["set", "what became of it", "acted", "replay"].map((title) => el("th", { scope: "col" }, title)))),
      el("tbody", {}, sets.map((set, number) => el("tr", {}, el("th", { scope: "row" }, set.name), el("td", {}, fate(table, row, set, false)),
        el("td", {}, details[number].words[details[number].codes[row]] || "-"), el("td.replayed", {}, link(set, number))))))));
  }

  const place = document.getElementById("experiment");
  place.addEventListener("filled", async () => {
    const { id, experiment } = Experiment.open, details = await Packed.read("defended");
    if (Experiment.open?.id === id && !place.querySelector("section.defended")) place.querySelector("section.happened").after(part(experiment, details));
  });

  return { MARKS, outcomeOf };
})();
