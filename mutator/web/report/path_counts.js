// @ts-check
"use strict";
// Shows the counts of the chosen fault type in the control structure, which report/path_drawing.py draws.

const PathCounts = (() => {
  const ALL = "all fault types", THIN = 1.8, WIDEST = 7;
  const share = ([through, came]) => (came ? `${through} of ${came}, ${Math.round((100 * through) / came)} %` : "");
  const boxLines = ([injected, stopped, masked]) => [
    [injected && `${injected} injected`, stopped && `${stopped} stopped`].filter(Boolean).join(", "), masked ? `${masked} masked` : ""];

  function start() {
    const place = document.getElementById("path-counts"), data = document.getElementById("path-counts-data");
    if (!place || !data) return;
    const counts = JSON.parse(data.textContent), picker = document.getElementById("path-counts-kind");
    picker.disabled = false;
    picker.addEventListener("change", () => show(place, picker.value, counts[picker.value]));
  }

  function show(place, kind, { active, links, components }) {
    const only = kind === ALL ? "" : `&kind=${encodeURIComponent(kind)}`;
    const filter = (element) => element.setAttribute("href", element.getAttribute("href").split("&")[0] + only);
    document.getElementById("path-counts-active").textContent = `${active} active`;
    for (const link of place.querySelectorAll("[data-link]")) {
      const numbers = links[link.dataset.link] || [0, 0], [through, came] = numbers;
      const state = through ? "through" : came ? "stopped" : "quiet", line = link.querySelector(".line");
      link.setAttribute("class", `link is-${state}`);
      line.setAttribute("marker-end", `url(#path-tip-${state})`);
      line.style.strokeWidth = `${THIN + (came ? ((WIDEST - THIN) * through) / came : 0)}px`;
      const [first, last = ""] = "short" in link.dataset ? share(numbers).split(", ") : [share(numbers)];
      link.querySelectorAll(".count").forEach((line, i) => { line.textContent = i ? last : first; });
      document.querySelector(`#path-counts-table [data-link="${CSS.escape(link.dataset.link)}"] td:last-child`).textContent = share(numbers) || "none reached it";
      filter(link);
    }
    for (const box of place.querySelectorAll("[data-component]")) {
      const numbers = components[box.dataset.component] || [0, 0, 0];
      box.setAttribute("class", `box${numbers[0] ? " has-injected" : ""}${numbers[1] ? " has-stopped" : ""}`);
      const lines = boxLines(numbers);
      box.querySelectorAll(".count").forEach((line, i) => { line.textContent = lines[i]; });
      filter(box);
    }
  }

  return { start };
})();

PathCounts.start();
