"use strict";
// The path of a fault through the controller: a box for each component in causal order, and how far the fault got.

const Path = (() => {
  /** What each state looks like and means; the word stands in the box. */
  const STATES = {
    injected: { sign: "⚡", word: "injected", about: "the fault is injected here" },
    reached: { sign: "●", word: "reached", about: "it left the golden run" },
    passed: { sign: "○", word: "passed on", about: "nothing that is recorded of it changed, but what it alone feeds did" },
    feedback: { sign: "↺", word: "by feedback", about: "it left the golden run only after the controlled process had" },
    held: { sign: "■", word: "held", about: "it stayed equal to the golden run" },
    unseen: { sign: "?", word: "not recorded", about: "nothing of it is recorded" },
  };
  let shown = null; // the strip that a replay lights up: {boxes: [[element, time]]}

  /** What left golden of an experiment: by component, each channel with its first time and largest deviation. */
  function departures(paths, row) {
    const found = new Map();
    paths.channels.forEach(([name, unit, component, about], i) => {
      const t = paths.first[i][row];
      if (t === null) return;
      if (!found.has(component)) found.set(component, []);
      found.get(component).push({ name, unit, about, t, largest: Number(paths.largest[i][row]) });
    });
    return found;
  }

  const seconds = (t) => `${t.toFixed(2)} s`;
  const amount = (x, unit) => `${Number.isFinite(x) ? x : "∞"}${unit === "-" ? "" : ` ${unit}`}`;
  const since = (t, begin) => (Number.isNaN(begin) ? "" : `${t < begin ? "−" : "+"}${Math.abs(t - begin).toFixed(2)} s`);
  const first = (channels) => Math.min(Infinity, ...channels.map((c) => c.t));

  /** Show the path of an experiment in `place`; `results` gives its row, and its cells by `text` and `number`. */
  async function strip(place, results) {
    shown = null;
    const paths = await Packed.read("paths");
    if (!place.isConnected) return; // another one was opened meanwhile
    const shape = paths ? paths.shapes[paths.shape[results.row]] : null;
    if (!shape) {
      place.replaceChildren(Dom.el("p.quiet", {}, paths ? none(results) : "This run recorded no paths: an earlier version of mutator made it, or no channel of the manifest names a component."));
      return;
    }
    const left = departures(paths, results.row), begin = results.number("t_activation");
    const stages = shape.map(([name, state, column]) => stage(name, state, column, left.get(name) || [], paths.by[results.row]?.[name], begin));
    const boxes = [];
    place.replaceChildren(said(results, paths), drawn(stages, paths, boxes), late(stages, paths), table(paths, left, begin));
    shown = { boxes };
    listen(place);
  }

  function none(results) {
    if (results.text("status") !== "ok") return "It did not end well, so no path was recorded.";
    if (results.text("outcome") === "not_activated") return "The fault was never active.";
    return "No component of the control structure has the file that the fault is injected into.";
  }

  /** In a sentence how far it got. */
  function said(results, paths) {
    const label = (name) => paths.components[name]?.label || name;
    const all = (names) => names.split(";").map(label).join(" and ");
    const reached = results.text("reached"), stopped = results.text("stopped_at");
    const far = reached ? `The fault changed what is recorded as far as ${label(reached)}.` : "The fault changed nothing that is recorded along its path.";
    return Dom.el("p", {}, far, stopped ? [" It was stopped at ", Dom.el("strong", {}, all(stopped)), "."] : "");
  }

  /** A component of the path: `t` is when it changed, `by` that it did so at the latest, as what it alone feeds had. */
  function stage(name, state, column, channels, by, begin) {
    const own = first(channels), t = state === "injected" ? begin : by ?? own;
    return { name, state, column, channels, own, t: Number.isNaN(t) ? Infinity : t, by: state !== "injected" && by !== undefined, begin };
  }

  /** The boxes, those side by side that come equally far along the path. */
  function drawn(stages, paths, boxes) {
    const { el } = Dom;
    const columns = [];
    for (const one of stages) (columns[one.column] ??= []).push(one);
    return el("div.scroll", { tabindex: 0, role: "group", "aria-label": "Path of the fault" }, el("ol.path-strip", {}, columns.map((together) =>
      el("li", {}, together.map((one) => {
        const made = box(one, paths);
        boxes.push([made, one.t]);
        return made;
      })))));
  }

  function box(one, paths) {
    const { el } = Dom;
    const { sign, word, about } = STATES[one.state];
    const { label, about: what } = paths.components[one.name] || { label: one.name, about: "" };
    const changed = one.channels.map((c) => `${c.name}: first at ${seconds(c.t)}, largest difference ${amount(c.largest, c.unit)}`);
    const why = one.by ? [`what it alone feeds had changed by ${seconds(one.t)}${one.own < Infinity ? `; its own channels show it from ${seconds(one.own)}` : ""}`] : [];
    return el(`div.path-box.is-${one.state}`, { "data-component": one.name, title: [`${label}. ${what}`, about, ...why, ...changed].join("\n") },
      el("strong", {}, label),
      el("span.state", {}, el("span", { "aria-hidden": "true" }, `${sign} `), word),
      one.t === Infinity ? "" : el("span.time", {}, one.by ? "by " : "", seconds(one.t), one.state === "injected" ? "" : el("span.quiet", {}, ` ${since(one.t, one.begin)}`)));
  }

  /** Why a component may come later than one behind it. */
  function late(stages, paths) {
    const { el } = Dom;
    const all = stages.filter((one) => one.state === "reached" && stages.some((other) => other.state === "reached" && other.column > one.column && other.t < one.t));
    const names = all.map((one) => paths.components[one.name]?.label || one.name).join(" and ");
    return names ? el("p.quiet", {}, `What is recorded of ${names} changed only after a component further along: the fault came there another way.`) : "";
  }

  /** Every channel that left golden, also of components off the path. */
  function table(paths, left, begin) {
    const { el } = Dom;
    const rows = [...left].flatMap(([component, channels]) => channels.map((c) => ({ ...c, component }))).sort((a, b) => a.t - b.t);
    if (!rows.length) return "";
    const heads = ["channel", "component", "first at", "from activation", "largest difference", "what it is"];
    return el("details", {}, el("summary", {}, `Channels that left the golden run (${rows.length} of ${paths.channels.length})`),
      el("div.scroll", {}, el("table", {}, el("thead", {}, el("tr", {}, heads.map((h) => el("th", { scope: "col" }, h)))),
        el("tbody", {}, rows.map((c) => el("tr", {}, el("th", { scope: "row" }, c.name), el("td", {}, paths.components[c.component]?.label || c.component),
          el("td.time", {}, seconds(c.t)), el("td.time", {}, since(c.t, begin)), el("td.time", {}, amount(c.largest, c.unit)), el("td", {}, c.about)))))));
  }

  /** Follow a replay of the same experiment. */
  function listen(place) {
    const panel = place.closest("#experiment");
    if (!panel || panel.dataset.path) return;
    panel.dataset.path = "listens";
    panel.addEventListener("replay-time", (event) => at(event.detail.t));
  }

  /** Light up what the fault has come to by the time t. */
  function at(t) {
    for (const [element, time] of shown?.boxes || []) {
      element.classList.toggle("is-lit", time <= t);
      element.classList.toggle("is-ahead", time > t && time < Infinity);
    }
  }

  return { strip, at };
})();
