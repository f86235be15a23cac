// @ts-check
"use strict";
// The forms of the first page: try a fault, and run a small campaign.

(() => {
  const { el } = Dom;
  const place = document.getElementById("start");
  if (!place) return;

  const option = (value, text = value) => el("option", { value }, text);
  const select = (name, options, more = {}) => el("select", { name, ...more }, options);
  const labelled = (text, field, hint = "") => el("label", {}, el("span", {}, text), field, hint ? el("small.quiet", {}, hint) : null);

  /** A form that starts a job; `order(fields)` returns the request. */
  function form(title, about, fields, verb, order) {
    const status = el("p", { role: "status" }), button = el("button.main", {}, verb);
    const element = el("form.order", { "aria-label": title, onsubmit: sent }, el("h3", {}, title), el("p.quiet", {}, about), el("div.fields", {}, fields), el("p", {}, button), status);
    async function sent(event) {
      event.preventDefault();
      button.disabled = true;
      status.className = "";
      status.textContent = "…";
      try {
        await Jobs.start(order(Object.fromEntries(new FormData(element))));
        status.textContent = "Added to the jobs.";
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
    const variants = select("variant", []);
    const fill = () => {
      const chosenSpec = specs.find((spec) => spec.name === name.value);
      variants.replaceChildren(option("", "all"), ...(chosenSpec ? chosenSpec.variants.map((variant) => option(variant)) : []));
    };
    const name = el("input", { name: "spec", list: "specs", required: true, autocomplete: "off", spellcheck: "false", placeholder: specs[0]?.name || "", oninput: fill });
    const time = el("input", { name: "time", type: "number", min: 0, step: "0.01", value: 10, "aria-label": "Time in seconds", hidden: true });
    const trigger = select("trigger", [option("always"), option("time", "from a time (s)"), ...contexts.map((c) => option(c.name, `${c.name}: ${c.condition}`))],
      { onchange: () => (time.hidden = trigger.value !== "time") });
    fill();
    return form("Try a fault", "Inject one fault and run it once: diff, verdict and plot.", [
      labelled("Fault", el("span", {}, name, el("datalist", { id: "specs" }, specs.map((spec) => option(spec.name))))),
      labelled("Variant", variants), labelled("Scenario", select("scenario", scenarios.map((s) => option(s)))),
      labelled("Trigger", el("span.two", {}, trigger, time)),
      labelled("Value", el("input", { name: "value", inputmode: "decimal", pattern: "\\s*[\\-+]?[0-9.]+([eE][\\-+]?[0-9]+)?\\s*", title: "a number" }), "in the fault's unit; empty: random"),
      labelled("Seed", el("input", { name: "seed", type: "number", min: 0, step: 1 }), "empty: 0"),
      readings.length > 1 ? labelled("Reading", select("reading", readings.map((r) => option(r)))) : null,
      targets.length > 1 ? labelled("Target", select("target", targets.map((t) => option(t)))) : null,
    ], "Try it", (values) => ({
      kind: "try", spec: values.spec.trim(), scenario: values.scenario, trigger: values.trigger === "time" ? values.time : values.trigger,
      variant: orNull(values.variant), value: numberOrNull(values.value), seed: numberOrNull(values.seed), reading: orNull(values.reading), target: orNull(values.target),
    }));
  }

  function campaignForm({ campaigns }) {
    const name = el("input", { name: "name", required: true, pattern: "[A-Za-z0-9][A-Za-z0-9._\\-]*", title: "letters, digits, dots, hyphens", autocomplete: "off" });
    const campaign = select("campaign", campaigns.map((c) => option(c)), { onchange: suggest });
    function suggest() {
      const now = new Date(), two = (n) => String(n).padStart(2, "0");
      name.value = `${campaign.value}-${two(now.getMonth() + 1)}${two(now.getDate())}-${two(now.getHours())}${two(now.getMinutes())}`;
    }
    suggest();
    return form("Run a small campaign", "A sample of a campaign's experiments, spread over its plan.", [
      labelled("Campaign", campaign),
      labelled("At most", el("input", { name: "limit", type: "number", min: 1, max: 1000, value: 20, required: true }), "experiments"),
      labelled("Run folder", name, "next to the other runs"),
      labelled("Only", el("input", { name: "only", placeholder: "scenario == \"S1\"", autocomplete: "off", spellcheck: "false" }), "a filter; empty: all"),
      labelled("Seed", el("input", { name: "seed", type: "number", min: 0, step: 1 }), "empty: the campaign's"),
    ], "Run it", (values) => ({
      kind: "campaign", campaign: values.campaign, name: values.name.trim(), limit: Number(values.limit), only: orNull(values.only), seed: numberOrNull(values.seed),
    }));
  }

  Jobs.ask("/api/library").then((library) => {
    place.append(el("h2", {}, "Start a job"), library.problem ? el("p.bad", {}, library.problem) : "",
      el("div.orders", {}, library.specs.length ? tryForm(library) : null, library.campaigns.length ? campaignForm(library) : null));
  }).catch((error) => place.append(el("p.bad", { role: "alert" }, `The library cannot be read: ${error.message}.`)));
})();
