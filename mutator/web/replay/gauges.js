// @ts-check
"use strict";
// The instruments, which show the faulty and golden value of each channel. Pressing one shows or hides its plot.

class ReplayGauges {
  static FEW = 8; // number of instruments that a narrow screen shows at first
  static TEXTS = 100; // ms between text updates while playing, so that texts stay readable

  /** `isPlotted(name)` returns whether a channel is plotted; `toggle(name)` changes it. */
  constructor(channels, axisOf, { isPlotted, toggle }) {
    const { el } = Dom;
    this.isPlotted = isPlotted;
    this.written = -Infinity;
    this.gauges = channels.map((channel) => this.#gauge(channel, axisOf(channel), toggle));
    const all = el("button.more", { type: "button", onclick: () => {
      this.element.classList.add("has-all");
      all.remove();
    } }, `All ${channels.length} instruments`);
    this.element = el("div.gauges", { role: "group", "aria-label": "Instruments; those that are pressed have a plot" },
      this.gauges.map(({ button }) => button), channels.length > ReplayGauges.FEW ? all : null);
  }

  #gauge(channel, axis, toggle) {
    const { el } = Dom, unit = ReplayData.unit(channel), span = axis.high - axis.low;
    const share = (v) => Math.min(1, Math.max(0, (v - axis.low) / span));
    const faulty = el("b"), golden = el("span.of-golden"), fill = el("span.fill"), needle = el("span.needle");
    const button = el("button.gauge", { type: "button", title: channel.about || null, "aria-label": `Plot of ${channel.name}`, onclick: () => toggle(channel.name) },
      el("span.name", {}, channel.name, unit ? el("span.unit", {}, ` ${unit}`) : null, channel.role === "actuator" ? el("span.role", {}, "actuator") : null),
      el("span.values", {}, faulty, golden), el("span.bar", {}, el("span.zero", { style: `left:${100 * share(0)}%` }), fill, needle));
    return { channel, axis, share, places: ReplayData.digits(axis), button, faulty, golden, fill, needle };
  }

  /** Show the values at a time. `now` (ms) limits the rate of text updates. */
  show(t, now, isPlaying) {
    const isWritten = !isPlaying || now - this.written > ReplayGauges.TEXTS;
    if (isWritten) this.written = now;
    for (const gauge of this.gauges) this.#show(gauge, t, isWritten);
  }

  #show({ channel, share, places, button, faulty, golden, fill, needle }, t, isWritten) {
    const now = ReplayData.valueAt(channel, "faulty", t), before = ReplayData.valueAt(channel, "golden", t);
    const zero = share(0), to = Number.isNaN(now) ? zero : share(now);
    fill.style.transform = `translateX(${100 * Math.min(zero, to)}%) scaleX(${Math.abs(to - zero)})`;
    needle.style.transform = `translateX(${100 * share(before)}%)`;
    needle.hidden = Number.isNaN(before);
    if (!isWritten) return;
    const [text, other] = [now, before].map((value) => ReplayData.text(value, places));
    faulty.textContent = text;
    golden.replaceChildren(...(text === other ? [] : [Dom.el("span.visually-hidden", {}, "golden "), other]));
    button.classList.toggle("differs", text !== other);
  }

  /** Show which channels are plotted. */
  pressed() {
    for (const { channel, button } of this.gauges) button.setAttribute("aria-pressed", String(this.isPlotted(channel.name)));
  }
}
