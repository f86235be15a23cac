// @ts-check
"use strict";
// Shows the counts of the chosen fault type in the control structure, which report/fault_path_drawing.py draws.

const PathCounts = (() => {
  const ALL = "all fault types";

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
      const [state, width, share, interval] = links[link.dataset.link], line = link.querySelector(".line"), title = link.querySelector("title");
      title.textContent = `${title.textContent.split("\n")[0]}\n${interval}`;
      link.setAttribute("class", `link is-${state}`);
      line.setAttribute("marker-end", `url(#path-tip-${state})`);
      line.style.strokeWidth = width;
      const [first, last = ""] = "short" in link.dataset ? share.split(", ") : [share];
      link.querySelectorAll(".count").forEach((line, i) => { line.textContent = i ? last : first; });
      document.querySelector(`#path-counts-table [data-link="${CSS.escape(link.dataset.link)}"] td:last-child`).textContent = share ? `${share}; ${interval}` : "none reached it";
      filter(link);
    }
    for (const box of place.querySelectorAll("[data-component]")) {
      const [classes, ...lines] = components[box.dataset.component];
      box.setAttribute("class", classes);
      box.querySelectorAll(".count").forEach((line, i) => { line.textContent = lines[i]; });
      filter(box);
    }
  }

  return { start };
})();

PathCounts.start();
