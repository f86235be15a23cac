// @ts-check
"use strict";
// What the plots of a report share: a uPlot chart in the colours of the page, lines for limits, and the marks of scenarios.

const Chart = (() => {
  const HEIGHT = 320, FONT = "12px system-ui, sans-serif";
  const COLOURS = 6; // --mark-0 to --mark-5
  /** Shapes of marks around 0, about 1 px in radius. Their number shares no factor with COLOURS, so 42 scenarios differ. */
  const SHAPES = ["M1 0A1 1 0 1 1-1 0A1 1 0 1 1 1 0Z", "M-.9-.9h1.8v1.8h-1.8Z", "M0-1.15L1.1.85h-2.2Z", "M0-1.25L1.25 0L0 1.25L-1.25 0Z", "M0 1.15L1.1-.85h-2.2Z",
    "M-.4-1.15h.8v.75h.75v.8h-.75v.75h-.8v-.75h-.75v-.8h.75Z", "M0-1.2L1.14-.37L.71.97H-.71L-1.14-.37Z"];
  const schemes = ["(prefers-color-scheme: dark)", "print"].map((query) => matchMedia(query));

  /** Run uPlot, which the page has as text, because running it takes longer than all other scripts of a page without plots. */
  function load() {
    const text = document.getElementById("uplot");
    if (text?.type !== "text/plain") return;
    const script = Dom.el("script", { id: "uplot" });
    script.textContent = text.textContent; // the same text, whose hash a content security policy has
    text.replaceWith(script);
  }

  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  /** Marks of outcomes: shape and colour. */
  const ENDINGS = { hazard: [0, "hazard"], sdc: [1, "sdc"], masked: [2, "masked"], "not activated": [3, "idle"], "crashed or timed out": [4, "broken"],
    "hazard without a fault": [0, "hazard"], "no hazard": [2, "masked"] };

  const colour = (mark) => css(mark in ENDINGS ? ENDINGS[mark][1] : `mark-${mark % COLOURS}`);

  const shape = (mark) => SHAPES[mark in ENDINGS ? ENDINGS[mark][0] : mark % SHAPES.length];

  /** The mark of a scenario, by its number, or of an outcome, for a legend. */
  const icon = (mark) => Dom.svg("svg", { viewBox: "-1.6 -1.6 3.2 3.2", width: 14, height: 14, "aria-hidden": "true",
    class: `mark-icon of-${mark in ENDINGS ? ENDINGS[mark][1] : mark % COLOURS}` }, Dom.svg("path", { d: shape(mark) }));

  /** The smallest range that has all finite `values`, with a margin; it is never empty. */
  function rangeOf(values, { share = 0.06 } = {}) {
    const finite = values.filter(Number.isFinite);
    const low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (low > high) return [0, 1];
    const margin = (high - low) * share || Math.abs(high) * 0.1 || 1;
    return [low - margin, high + margin];
  }

  /** Draw a mark with a uPlot chart's context, at a place in px of its canvas. */
  function drawMark(context, mark, x, y, radius, { isFilled }) {
    const path = new Path2D(), drawn = colour(mark);
    path.addPath(new Path2D(shape(mark)), new DOMMatrix([radius, 0, 0, radius, x, y]));
    Object.assign(context, { strokeStyle: drawn, fillStyle: drawn, lineWidth: uPlot.pxRatio * 1.6 });
    context.globalAlpha = 0.75;
    if (isFilled) context.fill(path);
    context.globalAlpha = 1;
    context.stroke(path);
  }

  /** Draw a line with its words across a chart: horizontal at `y`, or vertical at `x`.
   *  @param {any} chart @param {{x?: number, y?: number, words: string, colour: string}} line */
  function drawLimit(chart, { x, y, words, colour: drawn }) {
    const { ctx: context, bbox } = chart, ratio = uPlot.pxRatio, isAcross = y !== undefined;
    const at = Math.round(isAcross ? chart.valToPos(y, "y", true) : chart.valToPos(x, "x", true));
    const [low, high] = isAcross ? [bbox.top, bbox.top + bbox.height] : [bbox.left, bbox.left + bbox.width];
    if (at < low || at > high) return;
    context.save();
    Object.assign(context, { strokeStyle: drawn, fillStyle: drawn, lineWidth: 1.5 * ratio, font: `${12 * ratio}px system-ui, sans-serif`, textBaseline: "bottom" });
    context.setLineDash([6 * ratio, 3 * ratio]);
    context.beginPath();
    context.moveTo(isAcross ? bbox.left : at, isAcross ? at : bbox.top);
    context.lineTo(isAcross ? bbox.left + bbox.width : at, isAcross ? at : bbox.top + bbox.height);
    context.stroke();
    const isLate = !isAcross && at > bbox.left + bbox.width / 2; // the words are on the wider side of the line
    context.textAlign = isAcross || isLate ? "right" : "left";
    const isTop = isAcross && at - bbox.top < 18 * ratio;
    if (isTop) context.textBaseline = "top";
    const place = isAcross ? [bbox.left + bbox.width - 4 * ratio, at + (isTop ? 3 : -2) * ratio] : [at + (isLate ? -4 : 4) * ratio, bbox.top + bbox.height - 4 * ratio];
    context.setLineDash([]);
    Object.assign(context, { strokeStyle: css("back"), lineWidth: 3 * ratio, lineJoin: "round" });
    context.strokeText(words, ...place); // a halo, for words over marks
    context.fillText(words, ...place);
    context.restore();
  }

  /** A chart in `place`. `x` and `y` have `label` and `range`, and perhaps `values`, which names ticks. `draw(chart)` draws above
   *  the lines. It follows the width of its place and the colours of the page until `place` gets another. */
  function chart(place, { x, y, series = [], data, draw, label }) {
    const scale = ({ range }) => ({ time: false, range });
    const axis = ({ label: words, values }, size) => ({ label: words, labelFont: FONT, font: FONT, labelSize: 22, size, stroke: () => css("quiet"), values,
      grid: { stroke: () => css("line"), width: 1 }, ticks: { stroke: () => css("line"), width: 1 } });
    const plot = new uPlot({
      width: Math.max(place.clientWidth, 200), height: HEIGHT, legend: { show: false }, pxAlign: true, padding: [10, 12, 0, 0],
      cursor: { x: false, y: false, points: { show: false }, drag: { x: false, y: false, setScale: false } },
      scales: { x: scale(x), y: scale(y) }, axes: [axis(x, 34), axis(y, 52)], series: [{}, ...series], hooks: { draw: [draw] },
    }, data, place);
    plot.ctx.canvas.setAttribute("role", "img");
    plot.ctx.canvas.setAttribute("aria-label", label);
    const observer = new ResizeObserver(() => {
      if (!plot.root.isConnected) return observer.disconnect();
      if (place.clientWidth && place.clientWidth !== plot.width) plot.setSize({ width: place.clientWidth, height: HEIGHT });
    });
    observer.observe(place);
    const over = new AbortController();
    for (const scheme of schemes) {
      scheme.addEventListener("change", () => (plot.root.isConnected ? plot.redraw(false) : over.abort()), { signal: over.signal });
    }
    return plot;
  }

  return { load, chart, rangeOf, drawMark, drawLimit, icon, css };
})();
