// @ts-check
"use strict";
// The table of experiments. Only visible rows are in the document.

class Grid {
  static ROW_PX = 30;
  static SPARE = 8; // extra rows rendered above and below the visible ones
  static PRINTED = 500; // rows printed on paper

  /** Column name, title, width in px and cell content. `narrow` columns are also shown on a phone, `beside` ones beside an opened
   *  experiment.
   *  @type {any[]} */
  static COLUMNS = [
    { name: "kind", title: "fault type", px: 174, narrow: true, beside: true, cell: (t, r) => Grid.kind(t.text(r, "kind")) },
    { name: "variant", title: "variant", px: 72 },
    { name: "value", title: "value", px: 102, beside: true, cell: (t, r) => `${t.text(r, "value")} ${t.text(r, "unit")}`.replace(/ -?$/, "") },
    { name: "scenario", title: "scenario", px: 76, narrow: true },
    { name: "method", title: "method", px: 68 },
    { name: "trigger", title: "trigger", px: 92, beside: true },
    { name: "ending", title: "outcome", px: 102, narrow: true, beside: true, cell: (t, r) => Grid.ending(t.text(r, "ending")) },
    { name: "severity", title: "severity", px: 104, narrow: true, cell: (t, r) => Grid.severity(t.called("severity", t.text(r, "severity"))) },
    { name: "t_activation", title: "activated", px: 80, time: true },
    { name: "t_manifest", title: "manifested", px: 95, time: true },
    { name: "hazards", title: "hazards", px: 72 },
    { name: "t_hazard", title: "hazard at", px: 82, time: true },
    { name: "alerts", title: "alerts", px: 90, cell: (t, r) => t.text(r, "alerts").replaceAll(";", ", ") },
    { name: "t_alert", title: "alert at", px: 70, time: true },
    { name: "reaction_time", title: "reaction", px: 74, time: true },
    { name: "experiment_id", title: "id", px: 76, cell: (t, r) => Dom.el("code", {}, t.text(r, "experiment_id").slice(0, 8)) },
  ];

  /** A fault type; its module is left out where there is little room. */
  static kind(text) {
    const [module, ...rest] = text.split(/(?<=\/)/);
    return rest.length ? [Dom.el("span.module", {}, module), ...rest] : text;
  }

  /** The outcome or status as a coloured label. */
  static ending(text) {
    return Dom.el(`span.ending.${text || "none"}`, {}, text.replaceAll("_", " "));
  }

  /** A severity class in words, with its code in the tooltip: S1 alone is also a scenario. */
  static severity(text) {
    return text ? Dom.el("span.class", { title: text }, text.split(" (severity ")[0]) : "";
  }

  /** A number with three significant digits, or '' if there is none. */
  static number(value) {
    return Number.isNaN(value) ? "" : String(Number(value.toPrecision(3)));
  }

  constructor(place, table, state, metrics = []) {
    this.place = place;
    this.table = table;
    this.state = state;
    this.rows = [];
    this.current = 0; // index in `rows` of the focused row
    this.isOnPaper = false;
    this.usual = Grid.COLUMNS.filter((column) => !table.count || table.columns.has(column.name)); // some targets have no alerts
    const methods = table.columns.get("method")?.words ?? [];
    if (methods.length === 1) this.usual = Grid.#withoutMethod(this.usual);
    this.more = Grid.#more(table, metrics);
    this.#choose();
    this.#build();
    place.addEventListener("scroll", () => this.#soon(), { passive: true });
    new ResizeObserver(() => this.#soon()).observe(place);
  }

  /** The columns without that of a method, which says nothing if it is the only one. Its room shows how long faults of an exploration
   *  are active, and how they change. */
  static #withoutMethod(columns) {
    const room = { variant: 30, trigger: 40 };
    const others = columns.filter((column) => column.name !== "method");
    return others.map((column) => ({ ...column, px: column.px + (room[column.name] ?? 0) }));
  }

  /** The columns that are hidden by default. Metrics have a unit and a meaning. */
  static #more(table, metrics) {
    const metricsByName = new Map(metrics.map(([name, unit, about]) => [name, { unit, about }]));
    const names = [...table.columns.keys()].filter((name) => !Grid.COLUMNS.some((column) => column.name === name));
    names.sort((a, b) => Number(metricsByName.has(b)) - Number(metricsByName.has(a)));
    return names.map((name) => {
      const { unit, about } = metricsByName.get(name) || {};
      const title = name.replaceAll("_", " ") + (unit && unit !== "-" ? ` [${unit}]` : "");
      const isNumber = Boolean(table.columns.get(name).numbers);
      return { name, title, about, isNumber, px: Math.max(70, 24 + 7.5 * title.length) };
    });
  }

  /** Show the columns that the state names, or the defaults. */
  #choose() {
    const names = this.state.columns;
    this.chosen = names.join();
    const all = [...this.usual, ...this.more];
    const columns = names.length ? all.filter((column) => names.includes(column.name)) : this.usual;
    this.columns = columns.length ? columns : this.usual;
  }

  #build() {
    const { el } = Dom;
    this.heads = this.columns.map((column) => {
      const button = el("button", { type: "button", onclick: () => this.#sortBy(column.name) }, column.title, el("span.arrow", { "aria-hidden": "true" }));
      return el(`th.${Grid.#classes(column)}`, { scope: "col", style: `width: ${column.px}px`, "data-column": column.name, title: column.about }, button);
    });
    this.body = el("tbody");
    const width = this.columns.reduce((sum, column) => sum + column.px, 0);
    this.element = el("table.grid", { "aria-label": "Experiments", style: `--width: ${width}px` },
      el("thead", {}, el("tr", { "aria-rowindex": 1 }, this.heads)), this.body);
    this.body.addEventListener("click", (event) => {
      const row = event.target.closest("tr[data-at]");
      if (row) this.open(Number(row.dataset.at));
    });
    this.place.replaceChildren(this.element);
  }

  static #classes(column) {
    return `${column.narrow ? "narrow" : "wide"}${column.beside ? ".beside" : ""}${column.time || column.isNumber ? ".time" : ""}`;
  }

  #sortBy(name) {
    const by = this.state.order;
    this.state.set({ sort: by === name ? `-${name}` : by === `-${name}` ? "" : name });
  }

  /** Show these rows, from the first one if they changed. If the open experiment is among them, it gets the focus. */
  show(rows) {
    const areOthers = rows.length !== this.rows.length || rows.some((row, at) => row !== this.rows[at]);
    this.rows = rows;
    this.place.style.setProperty("--rows", Math.max(1, rows.length)); // so that a short list has a small window
    if (this.state.columns.join() !== this.chosen) {
      this.#choose();
      this.#build();
    }
    this.opened = this.state.experiment ? this.table.find(this.state.experiment) : -1;
    const opened = this.rows.indexOf(this.opened);
    if (opened >= 0 || areOthers) this.current = Math.max(0, opened);
    if (areOthers) this.place.scrollTop = 0;
    this.element.setAttribute("aria-rowcount", String(rows.length + 1));
    const by = this.state.order.replace("-", "");
    for (const head of this.heads) {
      const isBy = head.dataset.column === by;
      const way = isBy ? (this.state.order.startsWith("-") ? "descending" : "ascending") : "none";
      head.setAttribute("aria-sort", way);
      head.querySelector(".arrow").textContent = isBy ? (way === "ascending" ? " ▲" : " ▼") : "";
    }
    if (areOthers && opened >= 0) this.reveal();
    else this.draw();
  }

  #soon() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = null;
      this.draw();
    });
  }

  /**
   * Draw for paper from `beforeprint` to `afterprint`, otherwise for the screen. `isOnPaper` is stored, because printing
   * scrolls and resizes the window, and the redraw that follows must not restore the screen's rows.
   */
  print(isOnPaper) {
    if (isOnPaper === this.isOnPaper) return;
    if (isOnPaper) this.scrolled = this.place.scrollTop; // paper has fewer rows, so the position would be lost
    this.isOnPaper = isOnPaper;
    this.draw();
    if (isOnPaper) return;
    this.place.scrollTop = this.scrolled;
    this.draw();
  }

  /** The rows to render: the visible ones and a margin; on paper, the first ones. */
  #span() {
    if (this.isOnPaper) return [0, Math.min(this.rows.length, Grid.PRINTED)];
    const visibleCount = Math.ceil(this.place.clientHeight / Grid.ROW_PX);
    const first = Math.max(0, Math.floor(this.place.scrollTop / Grid.ROW_PX) - Grid.SPARE);
    return [first, Math.min(this.rows.length, first + visibleCount + 2 * Grid.SPARE)];
  }

  /** Render the rows of the span. */
  draw() {
    const { el } = Dom;
    const [first, last] = this.#span(), more = this.rows.length - last;
    const hadFocus = this.body.contains(document.activeElement);
    const space = (count) =>
      count > 0 ? el("tr.space", { "aria-hidden": "true", style: `height: ${count * Grid.ROW_PX}px` }, el("td")) : null;
    const rowElements = [];
    for (let at = first; at < last; at++) rowElements.push(this.#row(at));
    this.body.replaceChildren(...[space(first), ...rowElements, this.isOnPaper ? null : space(more)].filter(Boolean));
    if (this.isOnPaper && more > 0) this.body.append(el("tr", {}, el("td.quiet", { colspan: this.columns.length }, `and ${more.toLocaleString("en")} more (not printed)`)));
    if (!this.rows.length) this.body.append(el("tr", {}, el("td.quiet", { colspan: 3 }, this.table.count ? "No experiment matches these filters." : "No experiment has run yet.")));
    if (hadFocus) this.#element(this.current)?.focus({ preventScroll: true });
  }

  #row(at) {
    const { el } = Dom;
    const row = this.rows[at], isCurrent = at === this.current, isOpen = row === this.opened;
    const cells = this.columns.map((column) => {
      const classes = `td.${Grid.#classes(column)}`;
      if (column.isNumber) return el(classes, {}, Grid.number(this.table.number(row, column.name)));
      const title = this.table.meaning(column.name, this.table.text(row, column.name)) || null; // without one, the row's
      if (!column.time) return el(classes, { title }, column.cell ? column.cell(this.table, row) : this.table.called(column.name, this.table.text(row, column.name)));
      const value = this.table.number(row, column.name);
      return el(classes, {}, Number.isNaN(value) ? "" : value.toFixed(2));
    });
    return el("tr", { "data-at": at, "aria-rowindex": at + 2, tabindex: isCurrent ? 0 : -1, class: isOpen ? "open" : null,
      "aria-selected": String(isOpen), title: this.table.text(row, "sentence") || this.table.text(row, "detail") || null }, cells);
  }

  #element(at) {
    return this.body.querySelector(`tr[data-at="${at}"]`);
  }

  /** Open the experiment at an index of the table. */
  open(at, options) {
    if (at < 0 || at >= this.rows.length) return;
    this.current = at;
    this.state.set({ experiment: this.table.text(this.rows[at], "experiment_id") }, options);
  }

  /** Move the focus by a number of rows. If an experiment is open, open the newly focused one instead. */
  move(by) {
    if (!this.rows.length) return;
    this.current = Math.max(0, Math.min(this.rows.length - 1, this.current + by));
    this.reveal();
    if (this.state.experiment) this.open(this.current, { replace: true });
    else this.focus();
  }

  /** The position of an experiment among the rows, such as `3 of 16`. */
  placeOf(experiment) {
    const at = this.rows.indexOf(this.table.find(experiment)), all = this.rows.length.toLocaleString("en");
    return at < 0 ? "not in this list" : `${(at + 1).toLocaleString("en")} of ${all}`;
  }

  /** Scroll the current row into view. */
  reveal() {
    const head = this.element.tHead.offsetHeight, top = this.current * Grid.ROW_PX;
    const room = this.place.clientHeight - head - Grid.ROW_PX;
    if (top < this.place.scrollTop) this.place.scrollTop = top;
    else if (top > this.place.scrollTop + room) this.place.scrollTop = top - room;
    this.draw();
  }

  focus() {
    this.#element(this.current)?.focus({ preventScroll: true });
  }
}
