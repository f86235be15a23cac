// @ts-check
"use strict";
// The plot of hazards by their time from the activation, with a line at a reaction time: shares, or counts where there are no rates.

class TimePlot {
  constructor(place) {
    this.room = Dom.el("div.room", {});
    this.words = Dom.el("p.reading", { role: "status" });
    place.replaceChildren(this.words, this.room);
  }

  /** Show `all` times to hazard (s, sorted) and those `of` the fault `name`, and read the shares at a reaction time (s). */
  show({ all, of, name, reaction, hasRates = true }) {
    this.words.textContent = TimePlot.sentence({ all, of, name, reaction, hasRates });
    this.room.replaceChildren();
    if (!all.length) return;
    const times = [...new Set([0, ...all, reaction])].sort((a, b) => a - b), end = Math.max(times[times.length - 1], 0.1) * 1.05;
    const scale = (some) => (hasRates ? 100 / some.length : 1);
    const within = (some) => [...times, end].map((time) => (some.length ? FaultValues.countWithin(some, time) * scale(some) : null));
    const y = hasRates ? { label: "share of hazards [%]", range: [0, 104] } : { label: "hazards", range: [0, 1.04 * all.length] };
    const stepped = uPlot.paths.stepped({ align: 1 }), line = (name, width) => ({ stroke: () => Chart.css(name), width, paths: stepped, points: { show: false } });
    Chart.chart(this.room, { x: { label: "time from activation to hazard [s]", range: [0, end] }, y,
      series: [line("quiet", 3), line("faulty", 2)], data: [[...times, end], within(all), within(of)], label: this.words.textContent,
      draw: (chart) => Chart.drawLimit(chart, { x: reaction, words: `reaction time ${reaction} s`, colour: Chart.css("ink") }) });
  }

  /** The hazards within a reaction time, in words. */
  static sentence({ all, of, name, reaction, hasRates = true }) {
    if (!all.length) return "No experiment has a hazard, so there is no time to one.";
    const part = (times, ofWhat) => {
      const count = FaultValues.countWithin(times, reaction);
      const percent = hasRates ? ` (${Math.round((100 * count) / times.length)} %)` : "";
      return `${count} of ${times.length} hazards of ${ofWhat}${percent}`;
    };
    const ofFault = of.length ? `, and ${part(of, name)}` : `. ${name} has no hazard`;
    return `Within ${reaction} s of the activation come ${part(all, "all faults")}${ofFault}. A driver who needs that long comes too late for these.`;
  }
}
