// @ts-check
"use strict";
/* One changed experiment below the table: what happened before and after, with links to both reports and both replays,
   which share a clock. The worst change is open at first. */
(() => {
  const panel = document.getElementById("pair"), table = document.querySelector("#changed tbody");
  if (!panel || !table) return;
  const { el } = Dom, facts = JSON.parse(document.getElementById("facts").textContent);
  const RAN = ["hazard", "sdc", "masked", "not_activated", "not_judged"]; // endings of runs that have channels
  const rows = [...table.rows], buttons = rows.map((row) => row.querySelector("button.open"));
  let open = -1;

  const isVisible = (row) => row.offsetParent !== null;

  /** Open the nearest visible row in a direction. */
  function move(by) {
    let to = open + by;
    while (rows[to] && !isVisible(rows[to])) to += by;
    if (rows[to]) show(to);
  }

  /** The place of the replay of one side, `a` or `b`, with what its row says about it. */
  function sideOf(row, number) {
    const { title, report } = facts.sides[number], button = row.querySelector("button.open"), id = number ? button.dataset.b : button.dataset.a;
    const place = el("div.content", {}, el("p.quiet", {}, "…")), ending = row.cells[2 + number], sentence = ending.querySelector(".sentence")?.textContent;
    const section = el("section", { "aria-label": title }, el("h4", {}, title),
      el("p", {}, sentence || [...ending.cloneNode(true).childNodes]),
      el("p", {}, report ? el("a", { href: `${report}#e=${id}` }, "Open ", el("code", {}, id), " in its report")
        : ["Experiment ", el("code", {}, id), "; the run has no report yet (", el("code", {}, "mutator report"), " writes it)"]), place);
    return { section, place, key: `${number ? "b" : "a"}/${id}`, ending: ending.querySelector(".ending").textContent, facts: { ...facts.sides[number], title } };
  }

  /** Why a side has no replay. */
  function reason(side, number) {
    if (!RAN.includes(side.ending)) return "The run did not finish normally, so there are no channels.";
    return open < facts.complete ? facts.sides[number].reason : facts.beyond;
  }

  async function fill(sides) {
    const now = open, loaded = await Promise.all(sides.map(({ key }) => SeriesFile.load(key, { trace: facts.traces[key], largest: {} }).catch((error) => error)));
    if (open !== now) return; // another one was opened in the meantime
    const drawn = sides.map((side, i) => ({ ...side, series: loaded[i] }));
    drawn.forEach((side, i) => {
      if (side.series instanceof Error) side.place.replaceChildren(el("p", { role: "alert" }, side.series.message));
      else if (!side.series) side.place.replaceChildren(el("p.quiet", {}, reason(side, i)));
    });
    const replayed = drawn.filter(({ series }) => series && !(series instanceof Error));
    if (replayed.length === 2) replayed.forEach((side, i) => { side.beside = { name: replayed[1 - i].facts.title, series: replayed[1 - i].series }; });
    Replay.showTogether(replayed);
    panel.dataset.ready = String(now);
  }

  function show(number, { isFocused = true } = {}) {
    rows[open]?.classList.remove("is-open");
    buttons[open]?.removeAttribute("aria-current");
    open = number;
    const row = rows[number];
    row.classList.add("is-open");
    buttons[number].setAttribute("aria-current", "true");
    const sides = [sideOf(row, 0), sideOf(row, 1)];
    const step = (text, name, by) => el("button", { type: "button", "aria-label": name, title: name, onclick: () => move(by) }, text);
    panel.hidden = false;
    panel.replaceChildren(
      el("header", {}, el("h3", { id: "pair-title", tabindex: -1 }, buttons[number].textContent),
        el("div.buttons", {}, el("span.quiet", {}, `${number + 1} of ${rows.length}`), step("↑", "Previous change", -1), step("↓", "Next change", 1))),
      el("p", {}, [...row.cells[1].cloneNode(true).childNodes]), el("div.sides", {}, sides.map(({ section }) => section)));
    if (isFocused) {
      panel.querySelector("h3").focus({ preventScroll: true });
      panel.scrollIntoView({ block: "start" });
    }
    fill(sides);
  }

  buttons.forEach((button, number) => button.addEventListener("click", () => show(number)));
  const first = rows.findIndex(isVisible);
  if (first >= 0) show(first, { isFocused: false });
})();
