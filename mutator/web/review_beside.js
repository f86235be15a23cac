"use strict";
// What the server knows beside a group, fetched when it comes into view: pictures, a typical experiment, changes.

const Beside = (() => {
  const { el } = Dom;
  const LEVELS = [["least", "least"], ["middle", "middle"], ["most", "most severe"]];

  /** An address with the query of the page, and more of it. */
  const query = (served, more = {}) => {
    const all = new URLSearchParams(served.query);
    for (const [name, value] of Object.entries(more)) all.set(name, value);
    return String(all) && `?${all}`;
  };

  /** An error of the server in words. */
  const words = ({ got, where, expected, remedy }) =>
    [where ? `${where}: ${got}` : got, expected && `expected ${expected}`, remedy].filter(Boolean).join("; ");

  /** What the server answers; null: there is no such thing. */
  async function get(address) {
    const response = await fetch(address, { headers: { accept: "application/json" } });
    if (response.ok) return response.json();
    if (response.status === 404) return null;
    const { error } = await response.json().catch(() => ({}));
    throw new Error(error ? words(error) : `the server answers ${response.status}`);
  }

  /** The road as the camera sees it, and the same road behind the effect, at three levels. */
  function pictures(group, served) {
    const figure = (level, side, title) => {
      const image = el("img", { src: `/review/${encodeURIComponent(served.target)}/${group.id}/picture/${level}-${side}.jpg${served.query}`, loading: "lazy", alt: `Road ${title}` });
      const shown = el("figure", {}, image, el("figcaption", {}, title));
      image.addEventListener("error", () => image.replaceWith(el("p.quiet.none", {}, "no picture")));
      return shown;
    };
    return el("div.pictures", { role: "group", "aria-label": "Pictures" }, figure("middle", "before", "before"),
      LEVELS.map(([level, title]) => figure(level, "after", `after, ${title}`)));
  }

  /** What the experiments of a group came to in a run, with links to a typical and the worst one. */
  async function typical(place, id, served, run) {
    if (place.dataset.run === run) return;
    place.dataset.run = run;
    place.hidden = !run;
    if (!run) return;
    place.replaceChildren(el("span.quiet", {}, "…"));
    const found = await get(`${served.api}/${id}/typical${query(served, { run })}`).catch((error) => error);
    if (place.dataset.run !== run) return; // another one was chosen meanwhile
    if (found instanceof Error) place.replaceChildren(el("span.quiet", {}, `No typical experiment: ${found.message}`));
    else place.replaceChildren(...told(found));
  }

  function told(found) {
    if (!found) return [el("span.quiet", {}, "This run has no experiment of this group.")];
    const counts = Object.entries(found.outcomes).map(([name, n]) => [el(`span.ending.${name}`, {}, `${n} ${name.replaceAll("_", " ")}`), " "]);
    const one = (title, experiment) => experiment && el("p", {}, el("b", {}, `${title}: `), experiment.verdict, " ",
      el("a", { href: experiment.link, target: "_blank", rel: "noopener", "aria-label": `Replay of experiment ${experiment.id}` }, "Replay"));
    const isOther = found.worst && found.worst.id !== found.typical?.id;
    return [el("p", {}, `${Card.plural(found.experiments, "experiment")} in this run: `, counts), one("Typical", found.typical), isOther ? one("Worst", found.worst) : null].filter(Boolean);
  }

  /** Calls `seen(element)` once for each observed element that comes near the screen. */
  function nearby(seen) {
    const observer = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) if (isIntersecting) seen(target);
    }, { rootMargin: "300px" });
    return observer;
  }

  async function changes(place, id, served) {
    place.replaceChildren(el("p.quiet", {}, "…"));
    const found = await get(`${served.api}/${id}/changes${served.query}`).catch((error) => error);
    if (found instanceof Error) place.replaceChildren(el("p", { role: "alert" }, `The changes cannot be shown: ${found.message}.`));
    else Changes.render(place, found?.changes || "");
  }

  return { pictures, typical, nearby, changes, words };
})();
