// @ts-check
"use strict";
// The review page: find, inspect and decide on groups. The part of the address after # is the view, so that it can be shared:
// #g=GROUP&q=words&state=new,changed&flag=1&diff=split

const Review = (() => {
  const { el } = Dom, { plural } = Card;
  const find = (id) => document.getElementById(id);
  const DECISIONS = ["approve", "reject"];

  class Page {
    constructor(data) {
      this.data = data;
      this.groups = new Map(data.groups.map((g) => [g.id, g]));
      this.messageTimers = new Map(); // group id -> timer of its card's message
      const actions = {
        mark: (ids, kind, text) => this.mark(ids, kind, text), show: (id) => this.#show(id), unfold: (id) => this.#unfold(id),
        resolve: (id, isMine) => this.#resolve(id, isMine),
      };
      this.cards = new Map(data.groups.map((g) => [g.id, new Card(g, data, actions)]));
      this.stacks = new Stacks(this.cards, { ...actions, mark: (ids, kind) => this.#ask(ids, kind) });
      this.conflicts = new Map(); // group id -> mark that could not be saved
      this.#read();
      this.#draw();
      this.#controls();
      this.marks = data.served ? this.#outbox() : new Commands(data, (ids) => this.#changed(ids));
      for (const [id, card] of this.cards) card.update(this.marks.pending(id));
      this.#apply();
      if (this.current) this.#show(this.current);
      addEventListener("popstate", () => {
        this.#read();
        this.#apply();
        if (this.current) this.#show(this.current);
      });
      addEventListener("keydown", (event) => this.#key(event));
    }

    #outbox() {
      return new Outbox(this.data.served, this.groups, {
        changed: (ids) => this.#changed(ids),
        saved: (ids) => ids.forEach((id) => this.#say(id, "saved")),
        refused: (id, words) => {
          this.#changed([id]);
          this.#say(id, `not saved: ${words}`, true);
        },
        conflict: (id, words, item) => this.#conflict(id, words, item),
        offline: (words) => {
          if (find("banner").textContent === words) return;
          find("banner").textContent = words;
          find("banner").hidden = !words;
        },
      });
    }

    #read() {
      const parameters = new URLSearchParams(location.hash.slice(1));
      this.query = parameters.get("q") || "";
      this.states = new Set((parameters.get("state") || "").split(",").filter((s) => this.data.states.includes(s)));
      this.isFlagged = parameters.get("flag") === "1";
      this.current = this.groups.has(parameters.get("g")) ? parameters.get("g") : "";
      this.mode = parameters.get("diff") === "split" ? "split" : "unified";
    }

    #write() {
      const state = new URLSearchParams();
      if (this.current) state.set("g", this.current);
      if (this.query) state.set("q", this.query);
      if (this.states.size) state.set("state", [...this.states].join(","));
      if (this.isFlagged) state.set("flag", "1");
      if (this.mode === "split") state.set("diff", "split");
      history.replaceState(null, "", `#${state}`);
    }

    #controls() {
      const button = (name, onclick) => el("button", { type: "button", "data-state": name, onclick });
      find("states").append(...this.data.states.map((state) => button(state, () => {
        if (!this.states.delete(state)) this.states.add(state);
        this.#apply();
      })));
      if (this.data.served) find("states").append(button("flagged", () => {
        this.isFlagged = !this.isFlagged;
        this.#apply();
      }));
      find("find").addEventListener("input", () => {
        this.query = find("find").value.trim();
        this.#apply();
      });
      find("bar").addEventListener("submit", (event) => event.preventDefault());
      for (const mode of ["unified", "split"]) find(mode).addEventListener("click", () => this.#layout(mode));
      for (const kind of DECISIONS) find(`${kind}-shown`).addEventListener("click", () => this.#ask(this.listedIds, kind));
      find("keys").addEventListener("click", () => find("help").showModal());
      if (this.data.served) this.#servedControls(this.data.served);
    }

    #servedControls({ by, runs }) {
      const name = find("by"), run = find("run"), key = "mutator-review by";
      name.value = localStorage.getItem(key) || by;
      name.addEventListener("input", () => localStorage.setItem(key, name.value.trim()));
      find("run-label").hidden = runs.length === 0;
      run.append(...runs.map(({ key: value, name: text }) => el("option", { value }, text)), el("option", { value: "" }, "none"));
      const cards = [...this.cards.values()], idOf = (place) => place.closest(".group").id.slice("group-".length);
      Beside.nearby((place) => Beside.pictures(place, idOf(place), this.data.served), document.querySelectorAll(".pictures"));
      let watched = null;
      const watch = () => {
        watched?.disconnect();
        watched = Beside.nearby((card) => Beside.typical(card.querySelector(":scope > .typical"), idOf(card), this.data.served, run.value), cards.map((card) => card.element));
      };
      run.addEventListener("change", watch);
      if (runs.length) watch();
    }

    #draw() {
      for (const card of this.cards.values()) card.diff(this.mode);
      find("groups").append(...[...this.cards.values()].map((card) => card.element),
        el("p.nothing.quiet", { id: "nothing", hidden: true }, "No group matches."));
    }

    #layout(mode) {
      this.mode = mode;
      for (const card of this.cards.values()) card.diff(mode);
      this.#apply();
    }

    /** Update groups. A group that no longer matches the filter stays visible until the filter changes. */
    #changed(ids) {
      for (const id of ids) this.cards.get(id).update(this.marks.pending(id));
      this.#apply({ isKept: true });
    }

    /** Mark groups. Repeating the decision on a single group without a text withdraws it. Returns false if nothing was marked. */
    mark(all, kind, text = "") {
      const { marks } = this;
      if (marks instanceof Commands) return marks.mark(all, kind);
      const ids = all.filter((id) => !this.groups.get(id).isOther);
      for (const id of all) if (!ids.includes(id)) this.#say(id, `not saved: ${Outbox.OTHER}`, true);
      if (!ids.length) return false;
      const by = find("by").value.trim();
      if (!by) {
        find("by").focus();
        find("by").reportValidity();
        return false;
      }
      const [id] = ids, isDown = !text && ids.length === 1 && this.cards.get(id).isMarked(kind, marks.pending(id));
      const changeKind = isDown ? (kind === "flag" ? "unflag" : "clear") : kind;
      for (const groupId of ids) {
        this.#settle(groupId);
        this.#say(groupId, "saving");
      }
      marks.add(ids.map((group) => ({ group, kind: changeKind, text })), by);
      return true;
    }

    #say(id, text, isBad = false) {
      clearTimeout(this.messageTimers.get(id));
      this.cards.get(id).say(text, isBad);
      if (text === "saved") this.messageTimers.set(id, setTimeout(() => this.cards.get(id).say(""), 4000));
    }

    #conflict(id, words, item) {
      this.conflicts.set(id, item);
      const { decision, flag } = this.groups.get(id);
      const other = decision ? `In the meantime: ${Card.describeDecision(decision)}.` : flag ? `In the meantime, ${flag.by} flagged this group.` : "In the meantime, the decision was withdrawn.";
      this.cards.get(id).conflict(`${other} Your mark was not saved: ${Card.name(item.kind).toLowerCase()}.`, item.kind);
      this.#say(id, "not saved", true);
      find("said").textContent = `${id}: ${words || other}`;
    }

    #settle(id) {
      this.conflicts.delete(id);
      this.cards.get(id).conflict("");
    }

    #resolve(id, isMine) {
      const { kind, text, by } = this.conflicts.get(id);
      this.#settle(id);
      this.#say(id, isMine ? "saving" : "");
      if (isMine && this.marks instanceof Outbox) this.marks.add([{ group: id, kind, text }], by);
      this.cards.get(id).element.focus({ preventScroll: true });
    }

    /** Approve or reject several groups after a question that shows their number and states. */
    #ask(ids, kind) {
      if (!ids.length) return;
      const verb = Card.VERBS[kind][0], folded = ids.filter((id) => this.cards.get(id).element.hidden).length;
      const states = this.data.states.map((state) => [state, ids.filter((id) => this.groups.get(id).state === state).length]).filter(([, n]) => n);
      const about = `Current states: ${states.map(([state, n]) => `${n} ${state}`).join(", ")}.`
        + (folded ? ` ${folded} of them ${folded === 1 ? "is" : "are"} folded under similar groups.` : "");
      Question.ask(`${verb} ${plural(ids.length, "group")}?`, about, `${verb} ${ids.length}`, () => this.mark(ids, kind));
    }

    /** Hide groups that do not match. With `isKept`, shown groups stay even if they no longer match. */
    #apply({ isKept = false } = {}) {
      const words = this.query.toLowerCase().split(/\s+/).filter(Boolean);
      const fits = (g) => (!this.states.size || this.states.has(g.state)) && (!this.isFlagged || g.flag)
        && words.every((w) => this.cards.get(g.id).words.includes(w));
      const before = new Set(isKept ? this.listedIds : []);
      this.listedIds = this.data.groups.filter((g) => fits(g) || before.has(g.id)).map((g) => g.id);
      const visible = this.stacks.fold(this.listedIds);
      for (const [id, { element }] of this.cards) element.hidden = !visible.has(id);
      find("nothing").hidden = this.listedIds.length > 0;
      this.#counts();
      if (find("find").value.trim() !== this.query) find("find").value = this.query;
      for (const mode of ["unified", "split"]) find(mode).setAttribute("aria-pressed", String(mode === this.mode));
      this.#write();
    }

    #counts() {
      const { groups, states } = this.data, all = plural(groups.length, "group");
      find("found").textContent = this.listedIds.length === groups.length ? all : `${this.listedIds.length} of ${all}`;
      for (const button of find("states").children) {
        const name = button.dataset.state, isFlag = name === "flagged";
        const count = groups.filter((g) => (isFlag ? g.flag : g.state === name)).length;
        button.textContent = `${name} ${count}`;
        button.setAttribute("aria-pressed", String(isFlag ? this.isFlagged : this.states.has(name)));
      }
      const isFiltered = this.listedIds.length < groups.length, none = this.listedIds.length === 0;
      for (const kind of DECISIONS) {
        find(`${kind}-shown`).textContent = `${Card.VERBS[kind][0]} ${!isFiltered ? `all ${groups.length}` : this.listedIds.length === 1 ? "this one" : `these ${this.listedIds.length}`}`;
        find(`${kind}-shown`).disabled = none || !states.length;
      }
    }

    #unfold(id) {
      const [first] = this.stacks.of(id);
      this.stacks.toggle(first);
      this.#apply({ isKept: true });
      if (this.cards.get(this.current)?.element.hidden) this.#show(first);
    }

    /** Make a group current, unfold it and scroll it into view. */
    #show(id) {
      this.current = id;
      const { element } = this.cards.get(id);
      if (element.hidden && this.listedIds.includes(id)) this.#unfold(id);
      for (const card of this.cards.values()) card.element.removeAttribute("aria-current");
      element.setAttribute("aria-current", "true");
      element.focus({ preventScroll: true });
      element.scrollIntoView({ block: "start" });
      this.#write();
    }

    #move(by) {
      const visible = this.listedIds.filter((id) => !this.cards.get(id).element.hidden);
      if (!visible.length) return;
      const at = visible.indexOf(this.current);
      this.#show(visible[at < 0 ? 0 : Math.min(Math.max(at + by, 0), visible.length - 1)]);
    }

    #key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || find("help").open || find("ask").open) return;
      if (/^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName)) {
        if (event.key === "Escape") {
          event.preventDefault(); // because a browser would clear the search field
          this.#leave(event.target);
        }
        return;
      }
      const action = this.#keys()[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    }

    /** Leave a field and return to the current group. */
    #leave(field) {
      field.blur();
      this.cards.get(this.current)?.element.focus({ preventScroll: true });
    }

    #keys() {
      const id = this.current, card = id ? this.cards.get(id).element : null;
      const on = (todo) => () => card && !card.hidden && todo();
      const open = (name) => on(() => {
        const details = card.querySelector(`:scope > details.${name}`);
        if (details && !details.hidden) details.open = !details.open;
      });
      const served = {
        u: on(() => this.groups.get(id).decision && this.mark([id], "clear")),
        f: on(() => this.mark([id], "flag")),
        c: on(() => card.querySelector(":scope > form.remark input").focus()),
        n: () => find("by").focus(),
      };
      return {
        j: () => this.#move(1), k: () => this.#move(-1),
        a: on(() => this.mark([id], "approve")), r: on(() => this.mark([id], "reject")),
        o: on(() => this.stacks.of(id).length > 1 && this.#unfold(id)), s: on(() => this.#ask(this.stacks.of(id), "approve")),
        A: () => this.#ask(this.listedIds, "approve"), R: () => this.#ask(this.listedIds, "reject"),
        v: open("values"), t: open("triggers"), d: open("since"),
        m: () => this.#layout(this.mode === "split" ? "unified" : "split"),
        "/": () => find("find").focus(), "?": () => find("help").showModal(),
        ...(this.data.served ? served : {}),
      };
    }
  }

  Packed.read("review").then((data) => {
    new Page(data);
    Guard.start(Boolean(data.served)).then(() => (document.documentElement.dataset.ready = ""));
  });
})();
