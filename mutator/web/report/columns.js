// @ts-check
"use strict";
// The fold-out menu in which the user chooses the columns of the list.

class Columns {
  constructor(place, grid, state) {
    const { el } = Dom;
    this.state = state;
    this.grid = grid;
    const all = [...grid.usual, ...grid.more];
    this.boxes = all.map((column) => {
      const box = el("input", { type: "checkbox", value: column.name, onchange: () => this.#choose() });
      return { box, element: el("label.option", { title: column.about }, box, column.title) };
    });
    this.element = el("details.facet", {}, el("summary", {}, "Columns"),
      el("fieldset", {}, el("legend.visually-hidden", {}, "Columns of the list"),
        el("button", { type: "button", onclick: () => state.set({ columns: [] }) }, "Default columns"), this.boxes.map((b) => b.element)));
    place.append(this.element);
  }

  #choose() {
    const names = this.boxes.filter(({ box }) => box.checked).map(({ box }) => box.value);
    const usual = this.grid.usual.map((column) => column.name);
    this.state.set({ columns: names.join() === usual.join() ? [] : names });
  }

  show() {
    const names = new Set(this.grid.columns.map((column) => column.name));
    for (const { box } of this.boxes) box.checked = names.has(box.value);
    this.element.classList.toggle("in-use", this.state.columns.length > 0);
  }
}
