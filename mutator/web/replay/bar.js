// @ts-check
"use strict";
// The time bar of a replay, which the user can drag. It has marks for events and, below, a button for each event.

class ReplayBar {
  /** `describe(t)` returns the state at a time as text. */
  constructor(series, clock, describe) {
    const { el } = Dom;
    this.series = series;
    this.clock = clock;
    this.describe = describe;
    this.handle = el("span.handle");
    this.progress = el("span.done");
    this.window = el("span.window", { hidden: true });
    this.element = el("div.timebar", { role: "slider", tabindex: 0, "aria-label": "Time of the replay", "aria-valuemin": series.start.toFixed(2),
      "aria-valuemax": series.end.toFixed(2), onpointerdown: (event) => this.#drag(event) },
      el("span.track"), this.progress, ...this.#parts(), this.window, this.handle);
    this.jumps = el("div.jumps", { role: "group", "aria-label": "Go to" }, series.marks.map((mark) => this.#jump(mark)));
  }

  /** A time as a share of the bar's width, in CSS. */
  #at = (t) => `${(100 * (t - this.series.start)) / (this.series.end - this.series.start || 1)}%`;

  #span(name, from, to, title) {
    const { el } = Dom, span = el(`span.${name}`, { title });
    span.style.left = this.#at(from);
    span.style.width = `calc(${this.#at(to)} - ${this.#at(from)})`;
    return span;
  }

  #parts() {
    const { el } = Dom, { active, tEnd, end, marks } = this.series, parts = [];
    if (active) parts.push(this.#span("active", active[0], Math.min(active[1], ReplayData.until(this.series)), `fault active, first to last: ${active[0].toFixed(2)} to ${active[1].toFixed(2)} s`));
    if (tEnd !== null) parts.push(this.#span("after", tEnd, end, "after the end of the drive: ignored by metrics"));
    return [...parts, ...marks.map(([kind, t]) => {
      const mark = el(`span.mark.${kind}`, { "aria-hidden": "true" }, ReplayScene.SYMBOLS[kind] ?? "•");
      mark.style.left = this.#at(t);
      return mark;
    })];
  }

  #jump([kind, t, label]) {
    const { el } = Dom;
    return el(`button.jump.${kind}`, { type: "button", title: `Go to ${t.toFixed(2)} s`, onclick: () => {
      this.clock.pause();
      this.clock.seek(t);
    } }, el("span.symbol", { "aria-hidden": "true" }, ReplayScene.SYMBOLS[kind] ?? "•"), ` ${label} `, el("span.when", {}, `${t.toFixed(2)} s`));
  }

  #drag(event) {
    if (event.button) return;
    event.preventDefault();
    this.element.focus({ preventScroll: true });
    this.element.setPointerCapture(event.pointerId);
    const { left: barLeft, width } = this.element.getBoundingClientRect(), { start, end } = this.series;
    const move = ({ clientX }) => {
      this.clock.pause();
      this.clock.seek(start + ((clientX - barLeft) / width) * (end - start));
    };
    const over = new AbortController(), { signal } = over;
    move(event);
    this.element.addEventListener("pointermove", move, { signal });
    for (const name of ["pointerup", "pointercancel"]) this.element.addEventListener(name, () => over.abort(), { signal });
  }

  /** Show the time. Describe it only while the replay is paused; otherwise a screen reader would never stop talking. */
  show() {
    const { isPlaying } = this.clock, { start, end } = this.series;
    const t = Math.min(end, Math.max(start, this.clock.t)), share = (t - start) / (end - start || 1); // a shared clock can be beyond this run
    this.handle.style.left = `${100 * share}%`;
    this.progress.style.transform = `scaleX(${share})`;
    if (isPlaying) return;
    this.element.setAttribute("aria-valuenow", t.toFixed(2));
    this.element.setAttribute("aria-valuetext", this.describe(t));
  }

  /** Show which part of the time the plots cover, unless they cover the whole run. */
  zoomed(from, to) {
    this.window.hidden = from <= this.series.start && to >= this.series.end;
    this.window.style.left = this.#at(from);
    this.window.style.width = `calc(${this.#at(to)} - ${this.#at(from)})`;
  }
}
