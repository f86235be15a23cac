// @ts-check
"use strict";
// Ignores clicks and keys that cannot be meant for a served review: events of scripts, repeats of a key that is held down, and
// input in the first instants after the page appears, which the user may have meant for the page before it.

const Guard = (() => {
  const CALM_MS = 500;
  const INPUT = ["click", "keydown", "submit"];
  let shownAtMs = performance.now();
  const remainingMs = () => shownAtMs + CALM_MS - performance.now();

  /** Whether a key that is held down would decide again. It may move between groups, scroll and edit text. */
  function isHeld({ repeat, key, target }) {
    return repeat && !/^(INPUT|TEXTAREA)$/.test(target.tagName) && (key === "Enter" || (key.length === 1 && !"jk".includes(key)));
  }

  function check(event) {
    if (event.isTrusted && remainingMs() <= 0 && !isHeld(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  /** Begin to ignore such input if `isOn`. The promise ends with the first instants. */
  async function start(isOn) {
    if (!isOn) return;
    for (const kind of INPUT) addEventListener(kind, check, { capture: true });
    document.addEventListener("visibilitychange", (event) => {
      if (event.isTrusted && !document.hidden) shownAtMs = performance.now();
    });
    await new Promise((resolve) => setTimeout(resolve, Math.max(0, remainingMs()) + 1));
  }

  return { start };
})();
