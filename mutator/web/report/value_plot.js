// @ts-check
"use strict";
// The plot of value and margin of a fault: a mark for each experiment, which the mouse or the keys choose and open.

class ValuePlot {
  static RADIUS = 4.5; // px of a mark
  static NEAR = 14; // px from the pointer in which the nearest mark is chosen
  static MOST_IN_LEGEND = 12; // scenarios in the legend
  static MOST_IN_TABLE = 500;

  /** `open(row)` opens an experiment, `describe(row)` says in words what it was; `groups` is the legend's name. */
  constructor(place, { open, describe, groups = "Scenarios" }) {
    const { el } = Dom;
    this.open = open;
    this.describe = describe;
    this.points = [];
    this.current = -1;
    this.last = 0; // the point to return to
    this.ring = el("span.ring", { hidden: true });
    this.room = el("div.room", {});
    this.stage = el("div.stage-of-values", { tabindex: 0, role: "application", "aria-roledescription": "plot", onkeydown: (event) => this.#key(event),
      onfocus: () => this.#choose(this.last), onblur: () => this.#choose(-1) }, this.room);
    this.about = el("p.point", { role: "status" });
    this.legend = el("ul.marks", { "aria-label": groups });
    this.body = el("div.scroll");
    this.table = el("details.as-table", { ontoggle: () => this.#fillTable() }, el("summary", {}, "The same points as a table"), this.body);
    place.replaceChildren(this.stage, this.about, this.legend, this.table);
    this.stage.addEventListener("pointermove", (event) => event.pointerType === "mouse" && this.#hover(event));
    this.stage.addEventListener("pointerleave", () => document.activeElement !== this.stage && this.#choose(-1));
    this.stage.addEventListener("click", (event) => this.#click(event));
  }

  /** Show points (FaultValues.pointsOf) of a fault over a measure; `limits` are [value, words]. `xValues` and `yValues` name ticks.
   *  @param {any} fault @param {any} measure @param {any[]} points @param {any[]} limits @param {{xValues?: any, yValues?: any}} names */
  show(fault, measure, points, limits, { xValues, yValues } = {}) {
    this.fault = fault;
    this.measure = measure;
    this.points = points;
    this.current = -1;
    this.last = 0;
    this.scenarios = [...new Set(points.map(({ scenario }) => scenario))].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
    this.numbers = new Map(this.scenarios.map((name, number) => [name, number]));
    const unit = (text) => (text ? ` [${text}]` : "");
    this.heads = [`${fault.axis ?? "value"}${unit(fault.unit)}`, `${measure.title}${unit(measure.unit)}`];
    const [x, y] = [points.map((point) => point.x), [...points.map((point) => point.y), ...limits.map(([value]) => value)]];
    this.stage.setAttribute("aria-label", `${this.heads[1]} against ${this.heads[0]} of ${fault.name}, ${points.length} experiments. Arrows move between them, Enter opens one.`);
    this.room.replaceChildren();
    this.chart = Chart.chart(this.room, { x: { label: this.heads[0], range: Chart.rangeOf(x), values: xValues }, y: { label: this.heads[1], range: Chart.rangeOf(y, { share: 0.1 }), values: yValues },
      data: [Chart.rangeOf(x)], label: `${this.heads[1]} against ${this.heads[0]}`, draw: (chart) => this.#draw(chart, limits) });
    this.chart.over.append(this.ring);
    this.#choose(-1);
    this.#showLegend();
    this.table.open = false;
  }

  #draw(chart, limits) {
    for (const { x, y, scenario, isHazard } of this.points) {
      Chart.drawMark(chart.ctx, this.markOf(scenario), chart.valToPos(x, "x", true), chart.valToPos(y, "y", true), ValuePlot.RADIUS * uPlot.pxRatio, { isFilled: isHazard });
    }
    for (const [y, words] of limits) Chart.drawLimit(chart, { y, words, colour: Chart.css("hazard") });
  }

  /** The number of the mark of a scenario. */
  markOf(scenario) {
    return this.numbers.get(scenario);
  }

  #showLegend() {
    const { el } = Dom, hidden = this.scenarios.length - ValuePlot.MOST_IN_LEGEND;
    this.legend.replaceChildren(...this.scenarios.slice(0, ValuePlot.MOST_IN_LEGEND).map((name) => el("li", {}, Chart.icon(this.markOf(name)), ` ${name}`)),
      hidden > 0 ? el("li.quiet", {}, `and ${hidden} more`) : "", this.points.length ? el("li.quiet", {}, "filled: with a hazard; hollow: without") : "");
  }

  #at = ({ x, y }) => [this.chart.valToPos(x, "x"), this.chart.valToPos(y, "y")];

  /** The number of the point that is nearest to the pointer; -1 if none is near. */
  #nearest(event) {
    if (!this.chart) return -1;
    const { left, top } = this.chart.over.getBoundingClientRect();
    let nearest = -1, least = ValuePlot.NEAR;
    this.points.forEach((point, number) => {
      const [x, y] = this.#at(point), distance = Math.hypot(x - event.clientX + left, y - event.clientY + top);
      if (distance <= least) [nearest, least] = [number, distance];
    });
    return nearest;
  }

  #hover(event) {
    const number = this.#nearest(event);
    if (number >= 0 || document.activeElement !== this.stage) this.#choose(number);
  }

  #click(event) {
    const number = this.#nearest(event);
    if (number >= 0) this.open(this.points[number].row);
  }

  #key(event) {
    const { current, points } = this, last = points.length - 1;
    if (event.ctrlKey || event.metaKey || event.altKey || last < 0) return;
    const keys = {
      ArrowRight: () => this.#choose(Math.min(last, current + 1)), ArrowLeft: () => this.#choose(Math.max(0, current - 1)),
      ArrowUp: () => this.#choose(this.#beside(1)), ArrowDown: () => this.#choose(this.#beside(-1)),
      Home: () => this.#choose(0), End: () => this.#choose(last), Enter: () => current >= 0 && this.open(points[current].row),
    };
    if (!keys[event.key]) return;
    keys[event.key]();
    event.preventDefault();
  }

  /** The number of the next point above (1) or below (-1) the current one, at whatever value; itself if there is none. */
  #beside(way) {
    const { y } = this.points[this.current];
    const order = this.points.map((point, number) => ({ number, y: way * point.y })).sort((a, b) => a.y - b.y || a.number - b.number);
    const place = order.findIndex(({ number }) => number === this.current);
    return (order[place + 1] ?? { number: this.current, y }).number;
  }

  /** Show a point's ring and words; -1: none. */
  #choose(number) {
    const point = this.points[number];
    this.current = point ? number : -1;
    this.ring.hidden = !point;
    this.stage.classList.toggle("is-on-point", Boolean(point));
    if (!point) return this.about.replaceChildren(Dom.el("span.quiet", {}, "Point at a mark for its experiment, and click to open it. With the keyboard: arrows, then Enter."));
    this.last = number;
    const [x, y] = this.#at(point);
    this.ring.style.transform = `translate(${x}px, ${y}px)`;
    this.about.replaceChildren(this.words(point));
  }

  /** What the point at which the user looks says.
   *  @param {any} point @returns {string} */
  words({ row, x, y, drive }) {
    const { fault, measure } = this, text = (value, unit) => `${Grid.number(value)}${unit ? ` ${unit}` : ""}`;
    return `${text(x, fault.unit)} in ${drive}: ${measure.title} ${text(y, measure.unit)}. ${this.describe(row)}`;
  }

  #fillTable() {
    const { el } = Dom, rest = this.points.length - ValuePlot.MOST_IN_TABLE;
    if (!this.table.open) return this.body.replaceChildren();
    this.body.replaceChildren(el("table.plain", {}, el("thead", {}, el("tr", {}, [...this.heads, "scenario", "experiment"].map((head) => el("th", { scope: "col" }, head)))),
      el("tbody", {}, this.points.slice(0, ValuePlot.MOST_IN_TABLE).map(({ row, x, y, drive }) => el("tr", {}, el("td.number", {}, Grid.number(x)), el("td.number", {}, Grid.number(y)),
        el("td", {}, drive), el("td", {}, el("button.link", { type: "button", onclick: () => this.open(row) }, this.describe(row))))))),
      rest > 0 ? el("p.quiet", {}, `and ${rest} more`) : "");
  }
}
