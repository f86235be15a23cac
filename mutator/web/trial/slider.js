// @ts-check
"use strict";
// A slider over the range of values that a fault's spec declares, with a field for the same value.

class Slider {
  static LATER_MS = 400; // a value is used when it has not changed for this time

  /** `range`: {low, high, step, unit}; `use(value)` is called with a value that the user chose. */
  constructor(place, range, use) {
    this.use = use;
    this.timer = 0;
    const { el } = Dom, { low, high, step, unit } = range, limits = `${low} to ${high}${unit ? ` ${unit}` : ""}`;
    this.rail = el("input", { type: "range", min: low, max: high, step, "aria-label": `Value, ${limits}`, oninput: () => this.#chose(this.rail, Slider.LATER_MS) });
    this.field = el("input", { type: "number", step: "any", "aria-label": `Value${unit ? ` in ${unit}` : ""}`, "aria-describedby": "vary-limits", onchange: () => this.#chose(this.field, 0) });
    place.replaceChildren(el("h2", { id: "vary-head" }, "Vary the value"),
      el("div.rail", {}, el("span.quiet", {}, String(low)), this.rail, el("span.quiet", {}, String(high)), el("span.typed", {}, this.field, unit ? ` ${unit}` : "")),
      el("p.quiet", { id: "vary-limits" }, `The spec declares ${limits}. Each value that you choose is driven again; a newer one cancels the one before.`));
  }

  get value() {
    return this.field.value;
  }

  /** Show a value that the page has, unless the user is choosing another one. */
  set(value) {
    if (this.timer) return;
    this.rail.value = this.field.value = String(value);
  }

  #chose(from, later) {
    const other = from === this.rail ? this.field : this.rail;
    other.value = from.value;
    clearTimeout(this.timer);
    this.timer = 0;
    if (from.value === "") return;
    this.timer = setTimeout(() => {
      this.timer = 0;
      this.use(Number(from.value));
    }, later);
  }
}
