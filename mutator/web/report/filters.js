// @ts-check
"use strict";
// The filters above the table: a fold-out menu with counts for each facet, and removable chips for chosen values.

class Filters {
  constructor(place, chips, table, state) {
    this.chips = chips;
    this.table = table;
    this.state = state;
    this.facets = table.facets.map((facet) => this.#facet(facet)).filter(Boolean);
    place.append(...this.facets.map((f) => f.element));
    document.addEventListener("click", (event) => this.#closeOthers(event.target));
    document.addEventListener("keydown", (event) => {
      const open = event.key === "Escape" && event.target.closest("details.facet[open]");
      if (!open) return;
      open.open = false;
      open.querySelector("summary").focus();
      event.preventDefault(); // so that the key does not also close an open experiment
    });
  }

  #closeOthers(target) {
    for (const element of document.querySelectorAll("details.facet[open]")) if (!element.contains(target)) element.open = false;
  }

  #facet(facet) {
    const { el } = Dom;
    if (facet.values.length < 2) return null; // nothing to choose from
    const { table } = this, options = facet.values.map((value) => {
      const box = el("input", { type: "checkbox", onchange: () => this.state.toggle(facet.name, value) });
      const count = el("span.count");
      return { value, box, count, element: el("label.option", { title: table.meaning(facet.name, value) }, box, el("span", {}, Filters.valueText(facet, table.called(facet.name, value))), count) };
    });
    const badge = el("b.badge");
    const element = el("details.facet", { "data-facet": facet.name },
      el("summary", {}, facet.title, " ", badge),
      el("fieldset", {}, el("legend.visually-hidden", {}, facet.title), options.map((o) => o.element)));
    return { facet, options, badge, element };
  }

  /** The text that shows a value. */
  static valueText(facet, value) {
    return facet.show ? facet.show(value) : value;
  }

  /** Show the chosen values, and the counts of `filter`. */
  show(counts) {
    for (const { facet, options, badge, element } of this.facets) {
      const chosen = this.state.chosen.get(facet.name) || new Set();
      badge.textContent = chosen.size ? String(chosen.size) : "";
      element.classList.toggle("in-use", chosen.size > 0);
      options.forEach(({ value, box, count, element: option }, i) => {
        box.checked = chosen.has(value);
        const number = counts.get(facet.name)[i];
        count.textContent = number.toLocaleString("en");
        option.classList.toggle("empty", number === 0);
      });
    }
    this.#showChips();
  }

  #showChips() {
    const { el } = Dom;
    const chip = (title, value, drop) =>
      el("button.chip", { type: "button", onclick: drop, "aria-label": `Remove filter ${title}: ${value}` },
        el("span.quiet", {}, `${title}: `), value, el("span", { "aria-hidden": "true" }, " ✕"));
    const chips = [];
    if (this.state.query) chips.push(chip("text", this.state.query, () => this.state.set({ query: "" })));
    for (const facet of Rows.FACETS) {
      const { name, title } = facet;
      for (const value of this.state.chosen.get(name) || []) {
        chips.push(chip(title.toLowerCase(), this.table.called(name, value), () => this.state.toggle(name, value)));
      }
    }
    if (chips.length > 1) chips.push(el("button.clear", { type: "button", onclick: () => this.state.clear() }, "Clear all"));
    this.chips.replaceChildren(...chips);
  }
}
