// @ts-check
"use strict";
// The path of a fault through the controller: a box for each component in causal order, with its state.

const Path = (() => {
  /** Sign, word and meaning of each state. */
  const STATES = {
    injected: { sign: "⚡", word: "injected", about: "the fault is injected here" },
    reached: { sign: "●", word: "reached", about: "it differs from the golden run" },
    passed: { sign: "○", word: "passed on", about: "none of its recorded channels changed, but a component that only it feeds did" },
    feedback: { sign: "↺", word: "by feedback", about: "it differs from the golden run, but only after the controlled process did" },
    held: { sign: "■", word: "held", about: "it stayed equal to the golden run" }, // eslint-disable-line id-denylist -- a state of stored paths
    unseen: { sign: "?", word: "not recorded", about: "it has no recorded channels" },
  };
  let currentStrip = null; // the strip in which a replay highlights boxes: {boxes: [[element, time]]}

  /** An experiment's channels that left the golden run, by component, with first times and largest deviations. */
  function departures(paths, row) {
    const channelsByComponent = new Map();
    paths.channels.forEach(([name, unit, component, about], i) => {
      const t = paths.first[i][row];
      if (t === null) return;
      if (!channelsByComponent.has(component)) channelsByComponent.set(component, []);
      channelsByComponent.get(component).push({ name, unit, about, t, largest: Number(paths.largest[i][row]) });
    });
    return channelsByComponent;
  }

  const seconds = (t) => `${t.toFixed(2)} s`;
  const amount = (x, unit) => `${Number.isFinite(x) ? x : "∞"}${unit === "-" ? "" : ` ${unit}`}`;
  const since = (t, begin) => (Number.isNaN(begin) ? "" : `${t < begin ? "−" : "+"}${Math.abs(t - begin).toFixed(2)} s`);
  const first = (channels) => Math.min(Infinity, ...channels.map((c) => c.t));

  /** Show the path of an experiment in `place`; `results` has its row and reads cells with `text` and `number`. */
  async function strip(place, results) {
    currentStrip = null;
    const paths = await Packed.read("paths");
    if (!place.isConnected) return; // another experiment was opened in the meantime
    const shape = paths ? paths.shapes[paths.shape[results.row]] : null;
    if (!shape) {
      place.replaceChildren(Dom.el("p.quiet", {}, paths ? none(results) : "This run has no paths: no channel of the manifest names a component."));
      return;
    }
    const channelsByComponent = departures(paths, results.row), begin = results.number("t_activation");
    const components = shape.map(([name, state, column]) => pathComponent(name, state, column, channelsByComponent.get(name) || [], paths.by[results.row]?.[name], begin));
    const boxes = [];
    place.replaceChildren(summary(results, paths), drawn(components, paths, boxes), late(components, paths), table(paths, channelsByComponent, begin));
    currentStrip = { boxes };
    listen(place);
  }

  function none(results) {
    if (results.text("status") === "left_out") return "The experiment was left out, so no path was recorded.";
    if (results.text("status") !== "ok") return "The run did not finish normally, so no path was recorded.";
    if (results.text("outcome") === "not_activated") return "The fault was never active.";
    return "No component of the control structure contains the file with the fault.";
  }

  /** A sentence that says how far the fault got. */
  function summary(results, paths) {
    const label = (name) => paths.components[name]?.label || name;
    const all = (names) => names.split(";").map(label).join(" and ");
    const reached = results.text("reached"), stopped = results.text("stopped_at");
    const far = reached ? ["Farthest component that the fault reached: ", Dom.el("strong", {}, label(reached)), "."] : "The fault changed no recorded channel on its path.";
    return Dom.el("p", {}, far, stopped ? [" It was stopped at ", Dom.el("strong", {}, all(stopped)), "."] : "");
  }

  /** A component of the path. `t` is when it changed or, with `by`, the latest possible time, inferred from components that only it feeds. */
  function pathComponent(name, state, column, channels, by, begin) {
    const ownTime = first(channels), t = state === "injected" ? begin : by ?? ownTime;
    return { name, state, column, channels, ownTime, t: Number.isNaN(t) ? Infinity : t, by: state !== "injected" && by !== undefined, begin };
  }

  /** The boxes. Components at the same distance along the path share a column. */
  function drawn(components, paths, boxes) {
    const { el } = Dom;
    const columns = [];
    for (const component of components) (columns[component.column] ??= []).push(component);
    return el("div.scroll", { tabindex: 0, role: "group", "aria-label": "Path of the fault" }, el("ol.path-strip", {}, columns.map((together) =>
      el("li", {}, together.map((component) => {
        const element = box(component, paths);
        boxes.push([element, component.t]);
        return element;
      })))));
  }

  function box(component, paths) {
    const { el } = Dom;
    const { sign, word, about } = STATES[component.state];
    const { label, about: what } = paths.components[component.name] || { label: component.name, about: "" };
    const changed = component.channels.map((c) => `${c.name}: first at ${seconds(c.t)}, largest difference ${amount(c.largest, c.unit)}`);
    const why = component.by ? [`components that only it feeds had changed by ${seconds(component.t)}${component.ownTime < Infinity ? `; its own channels show it from ${seconds(component.ownTime)}` : ""}`] : [];
    return el(`div.path-box.is-${component.state}`, { "data-component": component.name, title: [`${label}. ${what}`, about, ...why, ...changed].join("\n") },
      el("strong", {}, label),
      el("span.state", {}, el("span", { "aria-hidden": "true" }, `${sign} `), word),
      component.t === Infinity ? "" : el("span.time", {}, component.by ? "by " : "", seconds(component.t), component.state === "injected" ? "" : el("span.quiet", {}, ` ${since(component.t, component.begin)}`)));
  }

  /** The reason why a component can change after one further along the path. */
  function late(components, paths) {
    const { el } = Dom;
    const all = components.filter((component) => component.state === "reached" && components.some((other) => other.state === "reached" && other.column > component.column && other.t < component.t));
    const names = all.map((component) => paths.components[component.name]?.label || component.name).join(" and ");
    return names ? el("p.quiet", {}, `Recorded channels of ${names} changed only after those of a component further along the path. The fault reached that component by another path.`) : "";
  }

  /** All channels that left the golden run, including those of components off the path. */
  function table(paths, channelsByComponent, begin) {
    const { el } = Dom;
    const rows = [...channelsByComponent].flatMap(([component, channels]) => channels.map((c) => ({ ...c, component }))).sort((a, b) => a.t - b.t);
    if (!rows.length) return "";
    const heads = ["channel", "component", "first at", "from activation", "largest difference", "meaning"];
    return el("details", {}, el("summary", {}, `Channels that differ from the golden run (${rows.length} of ${paths.channels.length})`),
      el("div.scroll", {}, el("table", {}, el("thead", {}, el("tr", {}, heads.map((h) => el("th", { scope: "col" }, h)))),
        el("tbody", {}, rows.map((c) => el("tr", {}, el("th", { scope: "row" }, c.name), el("td", {}, paths.components[c.component]?.label || c.component),
          el("td.time", {}, seconds(c.t)), el("td.time", {}, since(c.t, begin)), el("td.time", {}, amount(c.largest, c.unit)), el("td", {}, c.about)))))));
  }

  /** Show the time of a replay of the same experiment. */
  function listen(place) {
    const panel = place.closest("#experiment");
    if (!panel || panel.dataset.path) return;
    panel.dataset.path = "listens";
    panel.addEventListener("replay-time", (event) => at(event.detail.t));
  }

  /** Highlight the components that the fault has reached by time t. */
  function at(t) {
    for (const [element, time] of currentStrip?.boxes || []) {
      element.classList.toggle("is-lit", time <= t);
      element.classList.toggle("is-ahead", time > t && time < Infinity);
    }
  }

  return { strip };
})();
