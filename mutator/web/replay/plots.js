// @ts-check
"use strict";
// The plots below a replay: the chosen channels on one time axis, which the user can zoom and move.

class ReplayPlots {
  static NARROWEST = 0.2; // duration (s) of the narrowest view
  static CHOSEN = { actuator: 2, truth: 3, internal: 1 }; // maximum number of initial plots by role
  static BRIEF = 2; // maximum number of initial plots of a brief replay
  static SMALLEST_VISIBLE = 0.002; // the smallest visible difference, as a share of the axis
  static FACTOR = 1.6; // ratio of a zoom step

  /** `axisOf(channel)` returns its axis. `beside` is another experiment over the same time: {name, series}, or null.
   *  `isBrief`: begin with two plots at most. */
  constructor(channels, axisOf, series, clock, zoomed, { beside = null, isBrief = false } = {}) {
    const { el } = Dom;
    this.series = series;
    this.beside = beside;
    this.clock = clock;
    this.zoomed = zoomed;
    this.hovered = null;
    this.written = -Infinity;
    this.colours = null;
    this.channels = channels;
    this.axisOf = axisOf;
    this.plots = new Map(); // channel name -> its plot, once it was shown
    this.view = { from: series.start, to: series.end };
    this.axis = el("canvas.axis", { "aria-hidden": "true" });
    this.list = el("div.list", { onpointerdown: (event) => this.#press(event), onpointermove: (event) => this.#hover(event),
      onpointerleave: () => this.#look(null) });
    this.list.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    this.timeLabel = el("span.told");
    this.element = el("div.plots", {}, this.#tools(), this.list);
    this.chosen = new Set(this.#interesting(isBrief ? ReplayPlots.BRIEF : Infinity).map(({ name }) => name));
    this.#fill();
  }

  /** The initial channels, `most` at most: those of each role that differ most, or the first three if none differs. Roles that
   *  are not needed are not compared. */
  #interesting(most) {
    const begin = this.series.active?.[0] ?? this.series.start, end = ReplayData.until(this.series), differing = [];
    for (const [role, count] of Object.entries(ReplayPlots.CHOSEN)) {
      if (differing.length >= most) break;
      const ranked = this.channels.filter((channel) => channel.role === role).map((channel) => ({ channel, apart: ReplayData.apart(channel, this.axisOf(channel), begin, end) }))
        .filter(({ apart }) => apart > ReplayPlots.SMALLEST_VISIBLE).sort((a, b) => b.apart - a.apart);
      differing.push(...ranked.slice(0, count).map(({ channel }) => channel));
    }
    return (differing.length ? differing : this.channels.slice(0, 3)).slice(0, most);
  }

  #plotOf(channel) {
    if (!this.plots.has(channel.name)) this.plots.set(channel.name, new ReplayPlot(channel, this.axisOf(channel), this.series, this.beside));
    return this.plots.get(channel.name);
  }

  #tools() {
    const { el } = Dom;
    const button = (text, name, todo) => el("button", { type: "button", title: name, "aria-label": name, onclick: todo }, text);
    return el("div.tools", {},
      el("p.legend", {}, el("span.key.golden"), "golden", el("span.key.faulty"), "faulty", this.series.active ? [el("span.key.active"), "fault active"] : null,
        this.series.tEnd === null ? null : [el("span.key.after"), "after the end of the drive"],
        this.beside ? [el("span.key.beside"), this.beside.name] : null),
      this.timeLabel,
      el("div.buttons", { role: "group", "aria-label": "Time range shown" },
        button("−", "Zoom out (−)", () => this.zoom(-1)), button("+", "Zoom in (+)", () => this.zoom(1)),
        button("◀", "Earlier", () => this.pan(-0.4)), button("▶", "Later", () => this.pan(0.4)),
        button("Events", "From the activation to the end of the drive (e)", () => this.event()), button("Whole run", "The whole run (0)", () => this.all())));
  }

  #fill() {
    const shownPlots = this.channels.filter(({ name }) => this.chosen.has(name)).map((channel) => this.#plotOf(channel));
    this.list.replaceChildren(...shownPlots.map(({ element }) => element), shownPlots.length ? this.axis : Dom.el("p.quiet", {}, "No channel is chosen. Press one above."));
    this.shownPlots = shownPlots;
    this.width = 0; // so that the new plots are drawn
  }

  isPlotted = (name) => this.chosen.has(name);

  toggle(name) {
    if (!this.chosen.delete(name)) this.chosen.add(name);
    this.#fill();
    this.clock.redraw();
  }

  /** Plot those of the channels that this run has. */
  choose(names) {
    this.chosen = new Set(this.channels.map(({ name }) => name).filter((name) => names.has(name)));
    this.#fill();
  }

  /** Show a range of times, as far as this run has them. */
  cover(from, to) {
    this.#set(from, to);
  }

  /** Draw all plots over the available width. */
  draw(colours) {
    const width = Math.floor(this.list.clientWidth);
    if (!width || (width === this.width && colours === this.colours)) return;
    this.width = width;
    this.colours = colours;
    for (const plot of this.shownPlots) plot.draw(width, this.view, colours);
    this.#times(width, colours);
    this.written = -Infinity;
  }

  #times(width, colours) {
    const context = ReplayColours.fitted(this.axis, width, 20), { from, to } = this.view, [plot] = this.shownPlots;
    if (!plot) return;
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colours.quiet;
    context.textAlign = "center";
    for (const tick of ReplayData.ticks(from, to, Math.max(2, width / 110))) context.fillText(`${tick} s`, Math.min(width - 16, plot.x(tick, this.view)), 14);
  }

  /** Show the time under the pointer, or else that of the clock. `now` is in ms. */
  show(now, isPlaying) {
    if (isPlaying) this.#keepInView(this.clock.t);
    const t = this.hovered ?? this.clock.t, isWritten = !isPlaying || now - this.written > ReplayGauges.TEXTS;
    this.timeLabel.textContent = `${t.toFixed(2)} s`;
    if (isWritten) this.written = now;
    for (const plot of this.shownPlots) if (plot.width) plot.look(t, this.view, isWritten);
  }

  #keepInView(t) {
    const { from, to } = this.view;
    if (t >= from && t <= to) return;
    this.#set(t, t + to - from);
  }

  /** Preview a time without moving the clock; null ends the preview. */
  #look(t) {
    this.hovered = t;
    this.clock.redraw();
  }

  #timeAt(event) {
    const [plot] = this.shownPlots;
    if (!plot?.width) return null;
    const t = plot.time(event.clientX - plot.canvas.getBoundingClientRect().left, this.view);
    return t < this.view.from || t > this.view.to ? null : t;
  }

  #hover(event) {
    if (event.pointerType === "mouse" && !event.buttons) this.#look(this.#timeAt(event));
  }

  /** Pressing and dragging sets the time; with Shift, dragging moves the plots. */
  #press(event) {
    const t = this.#timeAt(event);
    if (event.button || t === null || !event.target.closest(".room, .axis")) return;
    if (event.pointerType === "mouse") event.preventDefault();
    this.hovered = null;
    const over = new AbortController(), { signal } = over, { from, to } = this.view;
    const move = (other) => {
      const by = ((event.clientX - other.clientX) / this.width) * (to - from), here = this.#timeAt(other);
      if (event.shiftKey) this.#set(from + by, to + by);
      else if (here !== null) {
        this.clock.pause();
        this.clock.seek(here);
      }
    };
    move(event);
    addEventListener("pointermove", move, { signal });
    for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => over.abort(), { signal });
  }

  /** The wheel zooms with Ctrl or a pinch. Sideways, or with Shift, it moves the plots. Otherwise it scrolls the page. */
  #wheel(event) {
    const aside = event.deltaX || (event.shiftKey ? event.deltaY : 0);
    if (event.ctrlKey) this.zoom(event.deltaY < 0 ? 0.5 : -0.5, this.#timeAt(event) ?? undefined);
    else if (aside && !this.isWhole) this.pan(aside / this.width);
    else return;
    event.preventDefault();
  }

  get isWhole() {
    return this.view.from <= this.series.start && this.view.to >= this.series.end;
  }

  /** Zoom in by a number of steps (negative: out) around a time. */
  zoom(steps, around = this.clock.t) {
    const { from, to } = this.view, { start, end } = this.series;
    const span = Math.min(end - start, Math.max(ReplayPlots.NARROWEST, (to - from) / ReplayPlots.FACTOR ** steps));
    const at = Math.min(to, Math.max(from, around)), viewStart = at - ((at - from) / (to - from)) * span;
    this.#set(viewStart, viewStart + span);
  }

  /** Move by a share of the view. */
  pan(share) {
    const { from, to } = this.view, by = share * (to - from);
    this.#set(from + by, to + by);
  }

  /** The time range of the drive's events, with a margin; null: no events. */
  get #event() {
    const { marks, active, start, end, tEnd } = this.series, until = ReplayData.until(this.series);
    const times = [...marks.map(([, t]) => t), ...(active ?? [])].filter((t) => t <= until);
    if (!times.length) return null;
    const first = Math.min(...times), last = tEnd ?? Math.max(...times), margin = Math.max(0.5, (last - first) * 0.08);
    return [Math.max(start, first - margin), Math.min(end, last + margin)];
  }

  /** Show the events, or everything if there are none. */
  event() {
    this.#set(...(this.#event ?? [this.series.start, this.series.end]));
  }

  all() {
    this.#set(this.series.start, this.series.end);
  }

  /** Show the drive and a short time after it; for a long drive, only the events. */
  begin() {
    const { start, end, tEnd } = this.series, until = tEnd === null ? end : Math.min(end, tEnd + 0.1 * (tEnd - start)), event = this.#event;
    if (event && event[1] - event[0] < (until - start) / 3) this.event();
    else this.#set(start, until);
  }

  #set(from, to) {
    const { start, end } = this.series, span = Math.min(to - from, end - start);
    const viewStart = Math.min(end - span, Math.max(start, from));
    this.view = { from: viewStart, to: viewStart + span };
    this.width = 0;
    this.zoomed(viewStart, viewStart + span);
    this.clock.redraw();
  }
}
