// @ts-check
"use strict";
// The current colours of the page for canvases, and canvases at screen resolution.

const ReplayColours = (() => {
  const modes = ["(prefers-color-scheme: dark)", "print"].map((query) => matchMedia(query)), coloursByMode = new Map();

  /** The colours by name. It is the same object until the colours change. */
  function now() {
    const mode = modes.map(({ matches }) => matches).join();
    if (!coloursByMode.has(mode)) coloursByMode.set(mode, read());
    return coloursByMode.get(mode);
  }

  function read() {
    const style = getComputedStyle(document.documentElement), of = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["golden", "faulty", "hazard", "ink", "quiet", "line", "raised", "road", "verge", "post", "paint", "other", "glass", "edge", "halo", "burst",
      "active", "after", "late", "between", "belief", "beside"];
    const colours = Object.fromEntries(names.map((name) => [name, of(`replay-${name}`) || of(name)]));
    return Object.assign(colours, { ground: of("raised"), alert: of("sdc"), manifest: of("masked"), defence: of("accent"), activation: of("ink"), goldenText: of("accent") });
  }

  /** Resize a canvas to this size in CSS pixels, and return its cleared context. */
  function fitted(canvas, width, height) {
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return context;
  }

  return { now, fitted };
})();
