// @ts-check
"use strict";
/* Filters the table of changed experiments by text and change, and shows the first matches. The URL fragment contains
   the chosen filters. */
(() => {
  const place = document.getElementById("changed");
  if (!place) return;
  const limit = Number(place.dataset.limit);
  const words = document.getElementById("words");
  const countElement = document.getElementById("shown");
  const buttons = [...document.querySelectorAll("button[data-change]")];
  const rows = [...place.querySelectorAll("tbody tr")].map((row) => ({
    row, text: row.textContent.toLowerCase(), changes: [...row.querySelectorAll(".change")].map((e) => e.textContent),
  }));

  /** Show the rows that have all chosen changes and words, up to the limit. */
  function filter() {
    const chosen = buttons.filter((b) => b.getAttribute("aria-pressed") === "true").map((b) => b.dataset.change);
    const parts = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const { row, text, changes } of rows) {
      const fits = chosen.every((c) => changes.includes(c)) && parts.every((p) => text.includes(p));
      count += fits;
      row.hidden = !fits || count > limit;
    }
    const more = count > limit ? `, the first ${limit} are shown` : "";
    countElement.textContent = `${count} of ${rows.length}${more}`;
    return new URLSearchParams({ ...(chosen.length && { c: chosen.join(",") }), ...(parts.length && { q: parts.join(" ") }) });
  }

  function changed() {
    history.replaceState(null, "", `#${filter()}`);
  }

  function restore() {
    const state = new URLSearchParams(location.hash.slice(1));
    const chosen = (state.get("c") || "").split(",");
    for (const b of buttons) b.setAttribute("aria-pressed", String(chosen.includes(b.dataset.change)));
    words.value = state.get("q") || "";
    filter();
  }

  for (const button of buttons) {
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
      changed();
    });
  }
  words.addEventListener("input", changed);
  addEventListener("hashchange", restore);
  restore();
  place.dataset.filtered = "";
})();
