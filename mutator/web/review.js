"use strict";
// The review page: groups found and shown, marks collected into the commands that make them decisions.
// What is shown is kept in the address behind #, so that it can be shared: #g=GROUP&q=words&state=new,changed&diff=split

const Review = (() => {
  const { el, copyButton } = Dom;
  const find = (id) => document.getElementById(id);
  const MARKS = { approve: "a", reject: "r" };
  const plural = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

  class Page {
    constructor(data) {
      this.data = data;
      this.marks = new Map(); // group id -> "approve" or "reject", in the order of marking
      this.cards = new Map();
      this.texts = new Map(data.groups.map((g) => [g.id, words(g)]));
      this.#read();
      this.#controls();
      this.#draw();
      this.#apply();
      if (this.current) this.#show(this.current);
      addEventListener("popstate", () => {
        this.#read();
        this.#apply();
        if (this.current) this.#show(this.current);
      });
      addEventListener("keydown", (event) => this.#key(event));
    }

    #read() {
      const given = new URLSearchParams(location.hash.slice(1));
      this.query = given.get("q") || "";
      this.states = new Set((given.get("state") || "").split(",").filter((s) => this.data.states.includes(s)));
      this.current = this.texts.has(given.get("g")) ? given.get("g") : "";
      this.mode = given.get("diff") === "split" ? "split" : "unified";
    }

    #write() {
      const state = new URLSearchParams();
      if (this.current) state.set("g", this.current);
      if (this.query) state.set("q", this.query);
      if (this.states.size) state.set("state", [...this.states].join(","));
      if (this.mode === "split") state.set("diff", "split");
      history.replaceState(null, "", `#${state}`);
    }

    #controls() {
      const counts = new Map();
      for (const g of this.data.groups) counts.set(g.state, (counts.get(g.state) || 0) + 1);
      find("states").append(...this.data.states.map((state) =>
        el("button", { type: "button", "data-state": state, onclick: () => this.#toggle(state) },
          `${state} ${counts.get(state) || 0}`)));
      find("find").addEventListener("input", () => {
        this.query = find("find").value.trim();
        this.#apply();
      });
      find("bar").addEventListener("submit", (event) => event.preventDefault());
      for (const mode of ["unified", "split"]) find(mode).addEventListener("click", () => this.#layout(mode));
      find("keys").addEventListener("click", () => find("help").showModal());
      for (const id of ["by", "remark"]) find(id).addEventListener("input", () => this.#commands());
    }

    #toggle(state) {
      if (!this.states.delete(state)) this.states.add(state);
      this.#apply();
    }

    #layout(mode) {
      this.mode = mode;
      for (const g of this.data.groups) this.#diff(g);
      this.#apply();
    }

    #draw() {
      for (const g of this.data.groups) {
        const card = this.#card(g);
        this.cards.set(g.id, card);
        this.#diff(g);
      }
      find("groups").append(...this.cards.values(), el("p.nothing.quiet", { id: "nothing", hidden: true }, "No group is like that."));
    }

    #diff(g) {
      renderDiff(this.cards.get(g.id).querySelector(".diffs"), g.diff, { mode: this.mode });
    }

    #card(g) {
      const when = g.trigger ? `${g.trigger}, ${g.hold}` : "in every mutant";
      const runs = g.runs === null ? "" : `, ${plural(g.runs, "experiment")}`;
      const mark = (verb) =>
        el("button", { type: "button", "data-mark": verb, "aria-pressed": "false", title: `Key ${MARKS[verb]}`,
          onclick: () => this.#mark(g.id, verb) }, verb === "approve" ? "Approve" : "Reject");
      return el("article.group", { id: `group-${g.id}`, tabindex: -1, "aria-labelledby": `id-${g.id}` },
        el("header", {},
          el("h2", { id: `id-${g.id}` }, el("a", { href: `#g=${g.id}`, onclick: (event) => this.#linked(event, g.id) }, g.id)),
          el(`span.state.${g.state}`, {}, g.state),
          el("span.quiet", {}, g.decision),
          el("span.marks", {}, mark("approve"), mark("reject"))),
        el("ul", {}, g.injections.map((text) => el("li", {}, injection(text)))),
        el("p.facts.quiet", {}, `${when}${g.faults ? `; ${plural(g.faults, "fault")}` : ""}${runs}`),
        el("div.diffs"),
        g.conditions.length ? disclosure(`Triggers (${g.conditions.length})`, el("ul", {}, g.conditions.map((c) => el("li", {}, c)))) : null,
        g.rows.length ? disclosure(`Values (${g.rows.length})${spans(g)}`, table(g), ".values") : null);
    }

    #linked(event, id) {
      event.preventDefault();
      this.#show(id);
    }

    #mark(id, verb) {
      if (this.marks.get(id) === verb) this.marks.delete(id);
      else this.marks.set(id, verb);
      for (const button of this.cards.get(id).querySelectorAll("[data-mark]"))
        button.setAttribute("aria-pressed", String(this.marks.get(id) === button.dataset.mark));
      this.#commands();
    }

    /** The commands that make the marks decisions. */
    #commands() {
      find("decide").hidden = this.marks.size === 0;
      const by = quoted(find("by").value.trim() || "NAME");
      const remark = find("remark").value.trim();
      find("commands").replaceChildren(...Object.keys(MARKS).flatMap((verb) => {
        const ids = [...this.marks].filter(([, v]) => v === verb).map(([id]) => id);
        if (!ids.length) return [];
        const parts = ["mutator review", verb, ...ids, this.data.options, `--by ${by}`, remark && `--remark ${quoted(remark)}`];
        const text = parts.filter(Boolean).join(" ");
        return [el("div.command", {}, el("code", {}, text), copyButton(() => text))];
      }));
    }

    /** Hide what is not asked for. */
    #apply() {
      const wanted = this.query.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const g of this.data.groups) {
        const fits = (!this.states.size || this.states.has(g.state)) && wanted.every((w) => this.texts.get(g.id).includes(w));
        this.cards.get(g.id).hidden = !fits;
        shown += fits;
      }
      find("nothing").hidden = shown > 0;
      find("found").textContent = shown === this.data.groups.length ? plural(shown, "group") : `${shown} of ${plural(this.data.groups.length, "group")}`;
      if (find("find").value.trim() !== this.query) find("find").value = this.query;
      for (const button of find("states").children) button.setAttribute("aria-pressed", String(this.states.has(button.dataset.state)));
      for (const mode of ["unified", "split"]) find(mode).setAttribute("aria-pressed", String(mode === this.mode));
      this.#write();
    }

    /** Make a group the current one and bring it into view. */
    #show(id) {
      this.current = id;
      for (const [name, card] of this.cards) {
        if (name === id) card.setAttribute("aria-current", "true");
        else card.removeAttribute("aria-current");
      }
      const card = this.cards.get(id);
      card.focus({ preventScroll: true });
      card.scrollIntoView({ block: "start" });
      this.#write();
    }

    #move(by) {
      const shown = this.data.groups.map((g) => g.id).filter((id) => !this.cards.get(id).hidden);
      if (!shown.length) return;
      const at = shown.indexOf(this.current);
      this.#show(shown[at < 0 ? 0 : Math.min(Math.max(at + by, 0), shown.length - 1)]);
    }

    #key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || find("help").open) return;
      if (/^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName)) {
        if (event.key === "Escape") event.target.blur();
        return;
      }
      const values = this.current && this.cards.get(this.current).querySelector("details.values");
      const done = {
        j: () => this.#move(1),
        k: () => this.#move(-1),
        a: () => this.current && this.#mark(this.current, "approve"),
        r: () => this.current && this.#mark(this.current, "reject"),
        v: () => values && (values.open = !values.open),
        m: () => this.#layout(this.mode === "split" ? "unified" : "split"),
        "/": () => find("find").focus(),
        "?": () => find("help").showModal(),
      }[event.key];
      if (!done) return;
      event.preventDefault();
      done();
    }
  }

  /** All that a group can be found by. */
  const words = (g) => [g.id, g.state, g.decision, ...g.injections, ...g.specs, g.trigger, g.hold].join(" ").toLowerCase();

  /** `place: model(parameters)` with the model standing out. */
  function injection(text) {
    const [, place, model, rest] = /^(.*): (\w+)(\(.*\))$/.exec(text) || [null, text, "", ""];
    return model ? [`${place}: `, el("span.model", {}, model), rest] : [place];
  }

  const disclosure = (title, content, name = "") => el(`details${name}`, {}, el("summary", {}, title), content);

  /** The span of each hole that holds numbers: `: by - 245.0 to - 12.0`; a seed's says nothing. */
  function spans(g) {
    const told = g.heads.slice(2).flatMap((head, i) => {
      const cells = g.rows.map((row) => [Number(row[i + 2].replaceAll(" ", "") || NaN), row[i + 2]]);
      if (head.endsWith("seed") || cells.some(([n]) => Number.isNaN(n))) return [];
      cells.sort(([a], [b]) => a - b);
      return [`${head} ${cells[0][1]} to ${cells.at(-1)[1]}`];
    });
    return told.length ? `: ${told.join(", ")}` : "";
  }

  function table(g) {
    return el("div.scroll", { tabindex: 0, role: "region", "aria-label": `Values of ${g.id}` },
      el("table", {},
        el("thead", {}, el("tr", {}, g.heads.map((head) => el("th", { scope: "col" }, head)))),
        el("tbody", {}, g.rows.map((row) => el("tr", {}, row.map((cell, i) => el(i < 2 ? "td" : "td.value", {}, cell)))))));
  }

  /** A word of a shell's command line. */
  const quoted = (text) => (/^[\w.@/-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

  Packed.read("review").then((data) => {
    new Page(data);
    document.documentElement.dataset.ready = "";
  });

  return { quoted };
})();
