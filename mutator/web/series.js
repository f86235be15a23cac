"use strict";
// Golden against faulty on one time axis: a panel for each channel, marks of what happened when, and beneath
// each panel a strip of how much the two differ.

const Series = (() => {
  const { el, svg } = Dom;
  const LEFT = 62, RIGHT = 10, HEIGHT = 78, STRIP = 7, GAP = 4, LABEL = 12, LETTER = 6.6, AXIS = 24; // px
  const BEYOND = 100; // so many times what a channel usually is: its axis is cut

  /** A channel as it is drawn here: lines of [times, values], null for no value, and a strip of differences. */
  function lined(channel) {
    const line = (values) => [[...channel.t], [...values].map((v) => (Number.isFinite(v) ? v : null))];
    const gap = [...channel.t].map((_, i) => Math.abs(channel.faulty[i] - channel.golden[i]) || 0);
    const largest = Number(Math.max(0, ...gap.filter(Number.isFinite)).toPrecision(5)), count = Math.min(160, gap.length);
    const strip = Array.from({ length: count }, (_, k) => {
      const most = Math.max(0, ...gap.slice(Math.floor((k * gap.length) / count), Math.floor(((k + 1) * gap.length) / count)));
      return most > 0 ? Math.min(9, Math.max(1, Math.round((9 * most) / largest))) : 0;
    }).join("");
    return { ...channel, golden: line(channel.golden), faulty: line(channel.faulty), strip, largest, until: channel.t.at(-1) };
  }

  /** Round numbers to label an axis from `low` to `high` with, about `count` of them. */
  function ticks(low, high, count) {
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) || 10);
    const made = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) made.push(Number((k * step).toPrecision(12)));
    return made;
  }

  /** A line through [times, values], broken where there is no value. */
  function path([times, values], x, y) {
    let d = "", isDown = false;
    for (let i = 0; i < times.length; i++) {
      if (values[i] === null) isDown = false;
      else {
        d += `${isDown ? "L" : "M"}${x(times[i]).toFixed(1)},${y(values[i]).toFixed(1)}`;
        isDown = true;
      }
    }
    return d;
  }

  /** What `channel` is no larger than in 98 % of the time, at least 1. */
  function usual(channel) {
    const held = [channel.golden, channel.faulty].flatMap(([times, values]) =>
      values.slice(0, -1).map((v, i) => [Math.abs(v), v === null ? 0 : times[i + 1] - times[i]]));
    held.sort(([a], [b]) => a - b);
    let left = 0.98 * held.reduce((sum, [, time]) => sum + time, 0);
    return Math.max(1, held.find(([, time]) => (left -= time) <= 0)?.[0] ?? 1);
  }

  /** The axis of a channel, and what is told if it is cut: a headway time near standstill goes to any height,
   *  and nothing else of the channel would be seen. */
  function range(channel) {
    const values = [...channel.golden[1], ...channel.faulty[1]].filter((v) => v !== null);
    let low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(low <= high)) [low, high] = [0, 1];
    const most = usual(channel);
    let cut = "";
    if (Math.max(-low, high) > BEYOND * most) {
      cut = `axis cut, values ${low} to ${high}; `;
      [low, high] = [Math.max(low, -2 * most), Math.min(high, 2 * most)];
    }
    // a narrower range would show rounding as something
    const least = Math.max(1e-6, Math.abs(high) * 1e-3);
    const margin = Math.max((high - low) * 0.08, least);
    return { low: low - margin, high: high + margin, cut };
  }

  function panel(channel, data, x, width, { low, high }) {
    const y = (v) => 4 + ((high - v) / (high - low)) * (HEIGHT - 8);
    const right = width - RIGHT, below = HEIGHT + GAP;
    const parts = [svg("rect", { x: LEFT, y: 0, width: right - LEFT, height: HEIGHT, class: "ground" })];
    if (data.active) {
      const [from, to] = data.active.map(x);
      parts.push(svg("rect", { x: from, y: 0, width: Math.max(1, to - from), height: HEIGHT, class: "active" }));
    }
    for (const tick of ticks(low, high, 3)) {
      parts.push(svg("line", { x1: LEFT, x2: right, y1: y(tick), y2: y(tick), class: "rule" }));
      parts.push(svg("text", { x: LEFT - 6, y: y(tick) + 3.5, "text-anchor": "end" }, String(tick)));
    }
    const lines = ["golden", "faulty"].map((run) => svg("path", { d: path(channel[run], x, y), class: run }));
    // a picture of its own, so that lines end where it does
    parts.push(svg("svg", { width: right + 2, height: HEIGHT }, lines));
    parts.push(svg("rect", { x: LEFT, y: below, width: right - LEFT, height: STRIP, class: "strip" }));
    const wide = (x(channel.until) - LEFT) / channel.strip.length;
    [...channel.strip].forEach((level, i) => {
      if (level === "0") return;
      const opacity = (0.25 + (0.75 * level) / 9).toFixed(2);
      parts.push(svg("rect", { x: LEFT + i * wide, y: below, width: wide + 0.3, height: STRIP, class: "gap", opacity }));
    });
    return svg("g", {}, parts);
  }

  const KINDS = ["activation", "manifest", "alert", "hazard"];

  /** The marks with their labels, each in the first line above the panels that has room for it. */
  function placed(data, x, width) {
    const lines = []; // of each the spans that are taken
    return data.marks.map(([kind, t, label]) => {
      const at = x(t), isLate = at > width - 130, text = `${label} ${t.toFixed(2)}`;
      const from = isLate ? at - text.length * LETTER : at, to = from + text.length * LETTER;
      let line = lines.findIndex((taken) => taken.every(([a, b]) => to < a || b < from));
      if (line < 0) line = lines.push([]) - 1;
      lines[line].push([from, to]);
      return { kind, at, isLate, text, line };
    });
  }

  function drawn({ kind, at, isLate, text, line }, labels, height) {
    return svg("g", { class: `mark ${KINDS.includes(kind) ? kind : ""}` },
      svg("line", { x1: at, x2: at, y1: labels - 6, y2: height - AXIS }),
      svg("text", { x: at + (isLate ? -3 : 3), y: 9 + LABEL * line, "text-anchor": isLate ? "end" : "start" }, text));
  }

  /** The value of a line at a time: that of the last point before it. */
  function at([times, values], t) {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return values[low];
  }

  function drawing(data, channels, width) {
    const x = (t) => LEFT + ((t - data.start) / (data.end - data.start || 1)) * (width - LEFT - RIGHT);
    const marks = placed(data, x, width), labels = 4 + LABEL * Math.max(1, ...marks.map(({ line }) => line + 1));
    const step = HEIGHT + GAP + STRIP + 18, height = labels + channels.length * step + AXIS;
    const names = channels.map((c) => c.name).join(", ");
    const made = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", class: "plot", "aria-label": `Golden and faulty run: ${names}` });
    channels.forEach((channel, i) => {
      const unit = channel.unit && channel.unit !== "-" ? ` [${channel.unit}]` : "";
      const largest = channel.largest ? `largest difference ${channel.largest}` : "no difference";
      const axis = range(channel);
      const g = svg("g", { transform: `translate(0,${labels + i * step + 12})` },
        svg("text", { x: LEFT, y: -4, class: "name" }, `${channel.name}${unit}`),
        svg("text", { x: width - RIGHT, y: -4, "text-anchor": "end", class: "said" }, axis.cut + largest),
        panel(channel, data, x, width, axis));
      made.append(g);
    });
    for (const tick of ticks(data.start, data.end, Math.max(3, width / 110))) {
      made.append(svg("text", { x: x(tick), y: height - 8, "text-anchor": "middle" }, `${tick} s`));
    }
    made.append(...marks.map((mark) => drawn(mark, labels, height)));
    const cursor = svg("line", { y1: labels, y2: height - AXIS, class: "cursor", visibility: "hidden" });
    made.append(cursor);
    return { element: made, cursor, time: (px) => data.start + ((px - LEFT) / (width - LEFT - RIGHT)) * (data.end - data.start), x };
  }

  /** Draw `channels` of `data` into `place`, as wide as it is, with a line under the pointer and what it says. */
  function draw(place, data, channels) {
    const told = el("p.readout", { "aria-live": "off" });
    const room = el("div");
    place.append(room, told);
    let shown = null;
    const render = () => {
      const width = Math.max(280, Math.floor(place.clientWidth));
      if (shown?.width === width) return;
      shown = { width, ...drawing(data, channels, width) };
      room.replaceChildren(shown.element);
    };
    render();
    room.addEventListener("pointermove", (event) => {
      const t = shown.time(event.clientX - shown.element.getBoundingClientRect().left);
      if (t < data.start || t > data.end) return;
      for (const name of ["x1", "x2"]) shown.cursor.setAttribute(name, shown.x(t));
      shown.cursor.setAttribute("visibility", "visible");
      const value = (v) => (v === null ? "-" : Number(v.toPrecision(4)));
      told.textContent = `${t.toFixed(2)} s: ` + channels.map((c) => `${c.name} ${value(at(c.golden, t))} → ${value(at(c.faulty, t))}`).join(", ");
    });
    new ResizeObserver(render).observe(place);
  }

  /** Show a series in `place`: what differs, and behind a fold what does not. */
  function show(place, series) {
    const data = { ...series, channels: series.channels.map(lined) };
    const differ = data.channels.filter((c) => c.largest), same = data.channels.filter((c) => !c.largest);
    const legend = el("p.legend", {}, el("span.key.golden"), "golden (no fault)", el("span.key.faulty"), "faulty",
      data.active ? [el("span.key.active"), "fault active, first to last"] : null, el("span.key.gap"), "difference");
    place.replaceChildren(legend);
    const first = differ.length ? differ : same.slice(0, 3), rest = differ.length ? same : same.slice(3);
    if (!differ.length) place.append(el("p.quiet", {}, "No channel differs from the golden run."));
    draw(place.appendChild(el("div.plots")), data, first);
    if (!rest.length) return;
    const fold = place.appendChild(el("details", {}, el("summary", {}, `${rest.length === 1 ? "1 channel" : `${rest.length} channels`} without a difference`)));
    fold.addEventListener("toggle", () => draw(fold.appendChild(el("div.plots")), data, rest), { once: true });
  }

  return { show };
})();
