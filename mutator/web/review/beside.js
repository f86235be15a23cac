// @ts-check
"use strict";
// Fetches the server's data on a group when it scrolls into view: images, a typical experiment, and changes.

const Beside = (() => {
  const { el } = Dom;
  const LEVELS = { least: "least", middle: "middle", most: "most severe" };

  /** An address with the query of the page and more parameters. */
  const query = (served, more = {}) => {
    const all = new URLSearchParams(served.query);
    for (const [name, value] of Object.entries(more)) all.set(name, value);
    return String(all) && `?${all}`;
  };

  /** An error of the server as text. */
  const words = ({ got, where, expected, remedy }) =>
    [where ? `${where}: ${got}` : got, expected && `expected ${expected}`, remedy].filter(Boolean).join("; ");

  /** The answer of the server; null if nothing was found. */
  async function get(address) {
    const response = await fetch(address, { headers: { accept: "application/json" } });
    if (response.ok) return response.json();
    if (response.status === 404) return null;
    const { error } = await response.json().catch(() => ({}));
    throw new Error(error ? words(error) : `the server answered ${response.status}`);
  }

  /** The target's image before and after the effect, at up to three levels. */
  async function pictures(place, id, served) {
    const address = (name) => `/review/${encodeURIComponent(served.target)}/${id}/picture/${name}.jpg${served.query}`;
    const figure = (name, title, about) => {
      const image = el("img", { src: address(name), alt: `Image ${title} ${about}`.trim() });
      const whole = el("a", { href: address(name), target: "_blank", rel: "noopener", title: "Full size" }, image);
      const element = el("figure", {}, whole, el("figcaption", {}, title, about ? el("span", {}, ` ${about}`) : ""));
      image.addEventListener("error", () => whole.replaceWith(el("p.quiet.none", {}, "no image")));
      return element;
    };
    const answer = await get(`${served.api}/${id}/pictures${served.query}`).catch((error) => error);
    if (answer instanceof Error) place.replaceChildren(el("p.quiet", {}, `No images: ${answer.message}.`));
    else if (!answer?.levels.length) place.hidden = true;
    else place.replaceChildren(figure("most-before", "before", ""),
      ...answer.levels.map(({ name, label }) => figure(`${name}-after`, `after, ${LEVELS[name] || name}:`, label)));
  }

  /** The results of a group's experiments in a run, with links to a typical experiment and the worst one. */
  async function typical(place, id, served, run) {
    if (place.dataset.run === run) return;
    place.dataset.run = run;
    place.hidden = !run;
    if (!run) return;
    place.replaceChildren(el("span.quiet", {}, "…"));
    const answer = await get(`${served.api}/${id}/typical${query(served, { run })}`).catch((error) => error);
    if (place.dataset.run !== run) return; // another run was chosen in the meantime
    if (answer instanceof Error) place.replaceChildren(el("span.quiet", {}, `No typical experiment: ${answer.message}`));
    else place.replaceChildren(...resultElements(answer, run));
  }

  function resultElements(results, run) {
    if (!results) return [el("span.quiet", {}, "This run has no experiment of this group.")];
    const counts = Object.entries(results.outcomes).map(([name, n]) => [el(`span.ending.${name}`, {}, `${n} ${name.replaceAll("_", " ")}`), " "]);
    const paragraph = (title, experiment) => experiment && el("p", {}, el("b", {}, `${title}: `), `${experiment.label}: ${experiment.verdict} `,
      el("a", { href: `/runs/${encodeURIComponent(run)}/report/index.html#e=${experiment.id}`, target: "_blank", rel: "noopener", "aria-label": `Replay of experiment ${experiment.id}` }, "Replay"));
    const isOther = results.worst && results.worst.id !== results.typical?.id;
    return [el("p", {}, `${Card.plural(results.experiments, "experiment")} in this run: `, counts), paragraph("Typical", results.typical), isOther ? paragraph("Worst", results.worst) : null].filter(Boolean);
  }

  /** Call `onNear` once for each of `elements`, when it comes near the visible area. */
  function nearby(onNear, elements) {
    const observer = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        observer.unobserve(target);
        onNear(target);
      }
    }, { rootMargin: "300px" });
    for (const element of elements) observer.observe(element);
    return observer;
  }

  async function changes(place, id, served) {
    place.replaceChildren(el("p.quiet", {}, "…"));
    const answer = await get(`${served.api}/${id}/changes${served.query}`).catch((error) => error);
    if (answer instanceof Error) place.replaceChildren(el("p", { role: "alert" }, `The changes cannot be shown: ${answer.message}.`));
    else Changes.render(place, answer?.changes || "");
  }

  return { pictures, typical, nearby, changes, words };
})();
