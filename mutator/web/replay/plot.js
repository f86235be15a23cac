// @ts-check
"use strict";
// Plots a channel over time: golden as a broad line, faulty as a narrow line above it, grey after the drive. The faulty line of
// another experiment can lie above them, dashed.

class ReplayPlot {
  static HEIGHT = 84; // px
  static LEFT = 58; // px for the labels of the axis
  static RIGHT = 8;

  /** `beside` is another experiment over the same time: {name, series}, or null. */
  constructor(channel, axis, series, beside) {
    const { el } = Dom, unit = ReplayData.unit(channel);
    this.channel = channel;
    this.axis = axis;
    this.series = series;
    this.beside = beside;
    this.other = beside?.series.channels.find(({ name }) => name === channel.name) ?? null; // its channel
    this.end = ReplayData.until(series);
    this.places = ReplayData.digits(axis);
    this.largest = ReplayData.largest(channel, this.end);
    this.golden = el("span.value.golden");
    this.faulty = el("span.value.faulty");
    this.by = el("span.value.by");
    this.ofOther = this.other ? el("span.value.beside", { title: beside.name }) : null;
    this.canvas = el("canvas", { role: "img", "aria-label": this.#inWords() });
    this.cursor = el("span.cursor");
    this.room = el("div.room", {}, this.canvas, this.cursor);
    this.element = el("div.plot-of", { "data-channel": channel.name }, el("div.head", {},
      el("span.name", { title: channel.about || null }, channel.name, unit ? ` [${unit}]` : ""), this.golden, this.faulty, this.by, this.ofOther), this.room, this.#note());
  }

  #text = (value) => ReplayData.text(value, this.places);

  #inWords() {
    const { by, t } = this.largest;
    const most = by ? `largest difference ${this.#text(by)} at ${t.toFixed(2)} s` : "no difference";
    return `${this.channel.name} from golden to faulty: ${most}, up to ${this.end.toFixed(2)} s${this.other ? `; dashed: ${this.beside.name}` : ""}`;
  }

  #note() {
    const [low, high] = (this.axis.cut ?? []).map((value) => String(Number(value.toPrecision(4))).replace("-", "−"));
    return low ? Dom.el("p.note", {}, `axis cut: values range from ${low} to ${high}`) : null;
  }

  /** The position of a time, in px of the canvas. */
  x(t, { from, to }) {
    return ReplayPlot.LEFT + ((t - from) / (to - from)) * (this.width - ReplayPlot.LEFT - ReplayPlot.RIGHT);
  }

  /** The time at a position of the canvas. */
  time(x, { from, to }) {
    return from + ((x - ReplayPlot.LEFT) / (this.width - ReplayPlot.LEFT - ReplayPlot.RIGHT)) * (to - from);
  }

  /** Draw the time from `view.from` to `view.to` over the available width. */
  draw(width, view, colours) {
    const { HEIGHT, LEFT, RIGHT } = ReplayPlot;
    this.width = width;
    const context = ReplayColours.fitted(this.canvas, width, HEIGHT);
    const x = (t) => this.x(t, view), { low, high } = this.axis, y = (v) => 3 + ((high - v) / (high - low)) * (HEIGHT - 6);
    context.fillStyle = colours.ground;
    context.fillRect(LEFT, 0, width - LEFT - RIGHT, HEIGHT);
    this.#scale(context, y, width, colours);
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width - LEFT - RIGHT, HEIGHT);
    context.clip();
    this.#happened(context, x, width, colours);
    this.#between(context, x, y, view, colours.between);
    this.#lines(context, x, y, view, colours);
    if (this.other) this.#besideLine(context, x, y, view, colours.beside);
    context.restore();
  }

  #scale(context, y, width, colours) {
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const tick of ReplayData.ticks(this.axis.low, this.axis.high, 3)) {
      context.fillStyle = colours.line;
      context.fillRect(ReplayPlot.LEFT, Math.round(y(tick)), width - ReplayPlot.LEFT - ReplayPlot.RIGHT, 1);
      context.fillStyle = colours.quiet;
      context.fillText(String(tick).replace("-", "−"), ReplayPlot.LEFT - 6, y(tick));
    }
  }

  #happened(context, x, width, colours) {
    const { active, marks } = this.series, { HEIGHT } = ReplayPlot;
    if (active) {
      const from = x(active[0]), to = x(Math.min(active[1], this.end));
      context.fillStyle = colours.active;
      context.fillRect(from, 0, Math.max(1, to - from), HEIGHT);
    }
    for (const [kind, t] of marks) {
      context.strokeStyle = colours[kind] ?? colours.ink;
      context.lineWidth = kind === "hazard" ? 1.8 : 1.2;
      context.setLineDash(kind === "hazard" ? [] : kind === "alert" ? [6, 3] : [2, 3]);
      context.beginPath();
      context.moveTo(x(t), 0);
      context.lineTo(x(t), HEIGHT);
      context.stroke();
    }
    context.setLineDash([]);
    if (this.series.tEnd === null) return;
    context.fillStyle = colours.after;
    context.fillRect(x(this.series.tEnd), 0, width, HEIGHT);
  }

  /** The time until which a value holds: that of the next value, or the end. */
  #holds = (i, channel = this.channel, end = this.series.end) => channel.t[i + 1] ?? end;

  /** The area between both runs during the drive, from activation. */
  #between(context, x, y, view, colour) {
    const { t, golden, faulty } = this.channel, begin = Math.max(view.from, this.series.active?.[0] ?? -Infinity), end = Math.min(view.to, this.end);
    context.fillStyle = colour;
    context.beginPath();
    for (let i = ReplayData.index(t, begin); i < t.length && t[i] < end; i++) {
      const from = Math.max(t[i], begin), to = Math.min(this.#holds(i), end);
      if (golden[i] === faulty[i] || !Number.isFinite(golden[i]) || !Number.isFinite(faulty[i])) continue;
      context.rect(x(from), y(golden[i]), x(to) - x(from), y(faulty[i]) - y(golden[i]));
    }
    context.fill();
  }

  #lines(context, x, y, { from, to }, colours) {
    context.lineJoin = "round";
    for (const [run, width, alpha] of [["golden", 3.4, 0.6], ["faulty", 1.6, 1]]) {
      Object.assign(context, { lineWidth: width, globalAlpha: alpha });
      for (const [begin, end, colour] of [[Math.max(from, this.end), to, colours.late], [from, Math.min(to, this.end), colours[run]]]) {
        context.strokeStyle = colour;
        this.#line(context, x, y, this.channel, run, begin, end);
      }
    }
    context.globalAlpha = 1;
  }

  /** The other experiment's line up to the end of its drive, with its hazards. */
  #besideLine(context, x, y, { from, to }, colour) {
    const { series } = this.beside, end = ReplayData.until(series);
    Object.assign(context, { strokeStyle: colour, lineWidth: 1.8 });
    context.setLineDash([7, 4]);
    this.#line(context, x, y, this.other, "faulty", Math.max(from, series.start), Math.min(to, end), series.end);
    context.setLineDash([1, 3]);
    for (const [kind, t] of series.marks) {
      if (kind !== "hazard") continue;
      context.beginPath();
      context.moveTo(x(t), 0);
      context.lineTo(x(t), ReplayPlot.HEIGHT);
      context.stroke();
    }
    context.setLineDash([]);
  }

  /** Draw a line of a channel between two times. Each value holds until the next. */
  #line(context, x, y, channel, run, from, to, last = this.series.end) {
    const { t } = channel, values = channel[run];
    let isDown = false;
    context.beginPath();
    for (let i = ReplayData.index(t, from); i < t.length && t[i] < to; i++) {
      const isThere = Number.isFinite(values[i]), height = y(Math.max(-1e9, Math.min(1e9, values[i])));
      if (isThere) context[isDown ? "lineTo" : "moveTo"](x(Math.max(t[i], from)), height);
      if (isThere) context.lineTo(x(Math.min(this.#holds(i, channel, last), to)), height);
      isDown = isThere;
    }
    context.stroke();
  }

  /** A signed difference, with enough digits that it does not show as 0. */
  #difference(by) {
    if (!Number.isFinite(by)) return "differs";
    const text = this.#text(by);
    return `${by > 0 ? "+" : ""}${/[1-9]/.test(text) ? text : by.toPrecision(1).replaceAll("-", "−")}`;
  }

  /** Put the cursor at a time, and show both values there if `isWritten`. */
  look(t, view, isWritten) {
    this.cursor.hidden = t < view.from - ReplayData.TINY || t > view.to + ReplayData.TINY;
    this.cursor.style.transform = `translateX(${this.x(t, view)}px)`;
    if (!isWritten) return;
    const golden = ReplayData.valueAt(this.channel, "golden", t), faulty = ReplayData.valueAt(this.channel, "faulty", t), by = faulty - golden;
    this.golden.textContent = this.#text(golden);
    this.faulty.textContent = this.#text(faulty);
    this.by.textContent = ReplayData.same(golden, faulty) ? "" : this.#difference(by);
    if (this.ofOther) this.ofOther.textContent = this.#text(ReplayData.valueAt(this.other, "faulty", t));
  }
}
