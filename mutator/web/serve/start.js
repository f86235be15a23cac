// @ts-check
"use strict";
// The forms of the first page: try a fault, and run a small campaign.

(() => {
  const { el } = Dom;
  const place = document.getElementById("start");
  if (!place) return;

  const option = (value, text = value) => el("option", { value }, text);
  const select = (name, options, more = {}) => el("select", { name, ...more }, options);
  const labelled = (text, field, hint = "") => el(`label${field.tagName === "SELECT" ? ".wide" : ""}`, {}, el("span", {}, text), field, hint ? el("small.quiet", {}, hint) : null);

  const shortened = (text) => (text.length > 90 ? `${text.slice(0, 89).trimEnd()}…` : text);

  /** What an option is: its name, and in words what it stands for. */
  const described = ({ name, about }) => option(name, about ? `${name}: ${shortened(about)}` : name);

  /** Options in groups, by what `groupOf` returns. */
  function grouped(items, groupOf, optionOf) {
    const groups = new Map();
    for (const item of items) groups.set(groupOf(item), [...(groups.get(groupOf(item)) ?? []), item]);
    return [...groups].map(([label, members]) => el("optgroup", { label }, members.map(optionOf)));
  }

  /** A form that starts a job; `order(fields)` returns the request, and `then(id, request, tell)` is called when it is started. */
  function form(title, about, fields, verb, order, then) {
    const status = el("p", { role: "status" }), button = el("button.main", {}, verb);
    const element = el("form.order", { "aria-label": title, onsubmit: sent }, el("h3", {}, title), el("p.quiet", {}, about), el("div.fields", {}, fields), el("p", {}, button), status);
    async function sent(event) {
      event.preventDefault();
      button.disabled = true;
      status.className = "";
      status.textContent = "…";
      try {
        const request = order(Object.fromEntries(new FormData(element)));
        const id = await Jobs.start(request);
        status.textContent = "Added to the jobs.";
        then(id, request, (text) => (status.textContent = text));
      } catch (error) {
        status.className = "bad";
        status.textContent = `Not started: ${error.message}.`;
      }
      button.disabled = false;
    }
    return element;
  }

  const orNull = (text) => (text?.trim() ? text.trim() : null);
  const numberOrNull = (text) => (text?.trim() ? Number(text) : null);

  function tryForm({ specs, scenarios, contexts, readings, targets }) {
    const variants = select("variant", [], { onchange: limit }), value = el("input", { name: "value", type: "number", step: "any" }), limits = el("small.quiet");
    const name = select("spec", grouped(specs, ({ module }) => module, described), { required: true, onchange: fill });
    const time = el("input", { name: "time", type: "number", min: 0, step: "0.01", value: 10, "aria-label": "Time in seconds", hidden: true });
    const trigger = select("trigger", [option("always"), option("time", "from a time (s)"),
      ...grouped(contexts, ({ table }) => `contexts: ${table}`, (c) => option(c.name, `${c.name}: ${c.condition}`))],
    { onchange: () => (time.hidden = trigger.value !== "time") });

    function fill() {
      variants.replaceChildren(...specs.find((spec) => spec.name === name.value).variants.map(described));
      limit();
    }

    /** Let the field of the value accept what the spec declares. */
    function limit() {
      const { range } = specs.find((spec) => spec.name === name.value).variants.find((variant) => variant.name === variants.value);
      value.disabled = !range;
      value.min = range ? range.low : "";
      value.max = range ? range.high : "";
      limits.textContent = range ? `${range.low} to ${range.high} ${range.unit}; empty: random` : "the fault has none";
    }

    fill();
    return form("Try a fault", "Inject one fault and run it once: what happened, replay, diff and metrics, and a slider for its value.", [
      labelled("Fault", name), labelled("Variant", variants), labelled("Scenario", select("scenario", scenarios.map(described))),
      el("label.wide", {}, el("span", {}, "Trigger"), el("span.two", {}, trigger, time)), el("label", {}, el("span", {}, "Value"), value, limits),
      labelled("Seed", el("input", { name: "seed", type: "number", min: 0, step: 1 }), "empty: 0"),
      readings.length > 1 ? labelled("Reading", select("reading", readings.map(described))) : null,
      targets.length > 1 ? labelled("Target", select("target", targets.map((t) => option(t)))) : null,
    ], "Try it", (values) => ({
      kind: "try", spec: values.spec, scenario: values.scenario, trigger: values.trigger === "time" ? values.time : values.trigger,
      variant: orNull(values.variant), value: numberOrNull(values.value), seed: numberOrNull(values.seed), reading: orNull(values.reading), target: orNull(values.target),
    }), openTrial);
  }

  let newestTrial = null;

  /** Open a trial when it has been driven, unless the user tries another one meanwhile. */
  function openTrial(id, _, tell) {
    const isFirst = newestTrial === null;
    newestTrial = id;
    tell("Driving; the trial opens when it is done.");
    if (!isFirst) return;
    Jobs.watch((jobs) => {
      const job = jobs.find((listed) => listed.id === newestTrial);
      if (!job || !["done", "failed", "cancelled"].includes(job.state)) return;
      newestTrial = ""; // opened once
      if (job.result) location.assign(job.result);
      else tell(`Not driven: ${job.message}.`);
    });
  }

  function campaignForm({ campaigns }) {
    const name = el("input", { name: "name", required: true, pattern: "[A-Za-z0-9][A-Za-z0-9._\\-]*", title: "letters, digits, dots, hyphens", autocomplete: "off" });
    const campaign = select("campaign", campaigns.map(described), { onchange: suggest });
    const limit = el("input", { name: "limit", type: "number", min: 1, max: 1000, value: 20, required: true });
    const only = el("input", { name: "only", placeholder: "scenario == \"S1\"", autocomplete: "off", spellcheck: "false" });
    const draw = el("select", { name: "draw" }, option("even", "each variant equally often"), option("proportional", "in proportion to the plan"));
    function suggest() {
      // results decide which experiments of an exploration follow
      limit.disabled = only.disabled = draw.disabled = campaigns.find((each) => each.name === campaign.value).explores;
      const now = new Date(), two = (n) => String(n).padStart(2, "0");
      name.value = `${campaign.value}-${two(now.getMonth() + 1)}${two(now.getDate())}-${two(now.getHours())}${two(now.getMinutes())}`;
    }
    suggest();
    return form("Run a small campaign", "A sample of a campaign's experiments, spread over its plan.", [
      labelled("Campaign", campaign),
      labelled("At most", limit, "experiments; an exploration runs whole"),
      labelled("Draw", draw),
      labelled("Run folder", name, "next to the other runs"),
      labelled("Only", only, "a filter; empty: all"),
      labelled("Seed", el("input", { name: "seed", type: "number", min: 0, step: 1 }), "empty: the campaign's"),
    ], "Run it", (values) => ({
      kind: "campaign", campaign: values.campaign, name: values.name.trim(), limit: Number(limit.value), proportional: draw.value === "proportional" && !draw.disabled, only: orNull(values.only), seed: numberOrNull(values.seed),
    }), (_, { name: run }) => location.assign(`/live/${encodeURIComponent(run)}`));
  }

  Jobs.ask("/api/library").then((library) => {
    place.append(el("h2", {}, "Start a job"), library.problem ? el("p.bad", {}, library.problem) : "",
      el("div.orders", {}, library.specs.length ? tryForm(library) : null, library.campaigns.length ? campaignForm(library) : null));
  }).catch((error) => place.append(el("p.bad", { role: "alert" }, `The library cannot be read: ${error.message}.`)));
})();
