// @ts-check
"use strict";
// The card of a group, with place, decision, diff, values and remarks.

class Card {
  static VERBS = { approve: ["Approve", "a"], reject: ["Reject", "r"] };
  static plural = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

  /** `actions`: mark(ids, kind, text), show(id), unfold(id), resolve(id, isMine). */
  constructor(group, data, actions) {
    this.group = group;
    this.data = data;
    this.actions = actions;
    this.element = this.#build();
  }

  #part(name) {
    return this.element.querySelector(`:scope > .${name}`);
  }

  get isServed() {
    return Boolean(this.data.served);
  }

  #build() {
    const { el } = Dom;
    const { group } = this, { id } = group;
    const linked = (event) => {
      event.preventDefault();
      this.actions.show(id);
    };
    return el("article.group", { id: `group-${id}`, tabindex: -1, "aria-labelledby": `id-${id}` },
      el("header.head", {},
        el("h2", { id: `id-${id}` }, el("a", { href: `#g=${id}`, onclick: linked }, id)),
        el("span.state"), el("span.flagged", { hidden: true }, "flagged"), el("span.kept.quiet", { role: "status" }), this.#buttons()),
      el("p.decision.quiet", { hidden: true }),
      el("div.conflict", { role: "alert", hidden: true }),
      group.titles.length ? el("ul.about", {}, group.titles.map((text) => el("li", {}, Dom.bound(text)))) : null,
      el("ul.what", {}, group.injections.map((text) => el("li", {}, Card.#injection(text)))),
      Card.#words(group.words ?? []),
      el("p.facts.quiet", {}, this.#facts()),
      this.isServed && group.pictures ? el("div.pictures", { role: "group", "aria-label": "Images" }, el("p.quiet", {}, "Drawing images …")) : null,
      el("div.typical", { hidden: true }),
      el("details.since", { hidden: true }, el("summary", {}, "Changed since the decision"), el("div.content")),
      el("div.diffs"),
      group.conditions.length ? Card.#disclosure(`Triggers (${group.conditions.length})`, el("ul", {}, group.conditions.map((c) => el("li", {}, c))), ".triggers") : null,
      group.rows.length ? Card.#disclosure(`Values (${group.rows.length})${Card.#spans(group)}`, this.#values(), ".values") : null,
      el("ul.remarks", { "aria-label": "Remarks", hidden: true }),
      this.isServed ? this.#remarkForm() : null,
      el("div.alike", { hidden: true }));
  }

  /** What the faults do, in words: the first and the last of them, and how many there are. */
  static #words(words) {
    const { el } = Dom;
    if (!words.length) return null;
    const listed = words.length > 3 ? [words[0], words[words.length - 1]] : words;
    const more = words.length - listed.length;
    return el("ul.words", { "aria-label": "In words" }, listed.map((text) => el("li", {}, text)), more ? el("li.quiet", {}, `and ${more} more`) : null);
  }

  #buttons() {
    const { el } = Dom;
    const { id } = this.group;
    const button = (kind, text, key) =>
      el("button", { type: "button", "data-mark": kind, "aria-pressed": "false", title: `Key ${key}`, "aria-label": `${text} ${id}`,
        onclick: () => this.actions.mark([id], kind) }, text);
    const decide = Object.entries(Card.VERBS).map(([kind, [text, key]]) => button(kind, text, key));
    return el("span.marks", {}, decide, this.isServed ? button("flag", "Flag", "f") : null);
  }

  #facts() {
    const { trigger, hold, faults, runs } = this.group;
    const kinds = trigger.split(" or "), last = kinds.pop();
    const when = trigger ? `${[kinds.join(", "), last].filter(Boolean).join(" or ")}; ${hold}` : "in every mutant";
    return `${when}${faults ? `; ${Card.plural(faults, "fault")}` : ""}${runs === null ? "" : `, ${Card.plural(runs, "experiment")}`}`;
  }

  #remarkForm() {
    const { el } = Dom;
    const { id } = this.group;
    const field = el("input", { "aria-label": `Remark about ${id}, or reason to reject it`, placeholder: "Remark, or reason to reject", maxlength: 2000, autocomplete: "off" });
    const save = (kind) => {
      const text = field.value.trim();
      if (text && this.actions.mark([id], kind, text)) {
        field.value = "";
        this.element.focus({ preventScroll: true });
      }
    };
    const saveRemark = (event) => {
      event.preventDefault();
      save("remark");
    };
    return el("form.remark", { onsubmit: saveRemark }, field, el("button", {}, "Save remark"),
      el("button", { type: "button", onclick: () => save("reject") }, "Reject for this reason"));
  }

  /** Show the current state of the group. `pending` has the kinds of marks that are being sent. */
  update(pending = new Set()) {
    const { group } = this, header = this.#part("head");
    const state = header.querySelector(".state");
    state.className = `state ${group.state}`;
    state.textContent = group.state;
    header.querySelector(".flagged").hidden = !group.flag;
    if (group.flag) header.querySelector(".flagged").title = `by ${group.flag.by}, ${Card.moment(group.flag.at)}`;
    for (const button of header.querySelectorAll("[data-mark]")) button.setAttribute("aria-pressed", String(this.isMarked(button.dataset.mark, pending)));
    const decision = this.#part("decision");
    decision.textContent = Card.describeDecision(group.decision);
    decision.hidden = !group.decision;
    this.#since();
    this.#remarks();
  }

  /** Whether a button is shown as pressed, for a mark that is being sent or else for a valid decision. */
  isMarked(kind, pending) {
    const { state, flag } = this.group;
    if (kind === "flag") return pending.has("flag") || (Boolean(flag) && !pending.has("unflag"));
    if (["approve", "reject", "clear"].some((other) => pending.has(other))) return pending.has(kind);
    return this.isServed && state === { approve: "approved", reject: "rejected" }[kind];
  }

  /** Show the state of the last mark, such as `saving`. */
  say(text, isBad = false) {
    const status = this.#part("head").querySelector(".kept");
    status.textContent = text;
    status.classList.toggle("bad", isBad);
  }

  /** Show another reviewer's change (empty: none). `mine` is the kind of the mark that was not saved. */
  conflict(words, mine) {
    const { el } = Dom;
    const place = this.#part("conflict");
    place.hidden = !words;
    if (!words) {
      place.replaceChildren();
      return;
    }
    const answer = (text, isMine) => el("button", { type: "button", onclick: () => this.actions.resolve(this.group.id, isMine) }, text);
    place.replaceChildren(el("p", {}, words), el("p", {}, answer(`${Card.name(mine)} anyway`, true), " ", answer("Leave unchanged", false)));
  }

  static name(kind) {
    return { approve: "Approve", reject: "Reject", clear: "Withdraw", flag: "Flag", unflag: "Remove the flag", remark: "Remark" }[kind];
  }

  /** A decision in one line: who, when, for which commit, and changes since. */
  static describeDecision(decision) {
    if (!decision) return "";
    const { verdict, by, at, reason, commit, tool, changed } = decision;
    const source = [commit && `commit ${commit.slice(0, 10)}`, tool && `mutator ${tool}`].filter(Boolean).join(", ");
    return [`${verdict} by ${by}${at ? `, ${Card.moment(at)}` : ""}${source ? ` (${source})` : ""}${reason ? `: ${reason}` : ""}`,
      changed.length ? `changed since: ${changed.join(", ")}` : ""].filter(Boolean).join("; ");
  }

  /** A time in the format and time zone of the user. */
  static moment(text) {
    const at = new Date(text);
    if (!text || Number.isNaN(at.getTime())) return text || "";
    return at.toLocaleString("en-GB", { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" });
  }

  #remarks() {
    const { el } = Dom;
    const list = this.#part("remarks"), { remarks } = this.group;
    list.hidden = remarks.length === 0;
    list.replaceChildren(...remarks.map(({ by, at, text }) => el("li", {}, el("span.quiet", {}, `${by}${at ? `, ${Card.moment(at)}` : ""}: `), text)));
  }

  /** Fetch the changes when they are opened, and again after each decision. */
  #since() {
    const since = this.#part("since"), isChanged = this.group.state === "changed";
    since.hidden = !isChanged;
    if (!isChanged) since.open = false;
    if (since.dataset.tied) return;
    since.dataset.tied = "yes";
    since.addEventListener("toggle", async () => {
      if (!since.open) return;
      const place = since.querySelector(".content");
      if (!this.isServed) Changes.render(place, this.group.changes);
      else await Beside.changes(place, this.group.id, this.data.served);
    });
  }

  diff(mode) {
    renderDiff(this.#part("diffs"), this.group.diff, { mode });
  }

  /** The text in which the search looks for words. */
  get words() {
    const g = this.group;
    return [g.id, g.state, Card.describeDecision(g.decision), ...g.titles, ...g.injections, ...g.specs, g.trigger, g.hold, ...g.remarks.map((r) => `${r.by} ${r.text}`)]
      .join(" ").toLowerCase();
  }

  /** `place: model(parameters)` with the model emphasized. */
  static #injection(text) {
    const [, place, model, rest] = /^(.*): (\w+)(\(.*\).*)$/.exec(text) || [null, text, "", ""];
    return model ? [`${place}: `, Dom.el("span.model", {}, model), rest] : [place];
  }

  static #disclosure(title, content, name = "") {
    return Dom.el(`details${name}`, {}, Dom.el("summary", {}, title), content);
  }

  /** The range of each numeric hole, without seeds, such as `: by - 245.0 to - 12.0`. */
  static #spans(g) {
    const spans = g.heads.slice(2).flatMap((head, i) => {
      const cells = g.rows.map((row) => [Number(row[i + 2].replaceAll(" ", "") || NaN), row[i + 2]]);
      if (head.endsWith("seed") || cells.some(([n]) => Number.isNaN(n))) return [];
      cells.sort(([a], [b]) => a - b);
      return [`${head} ${cells[0][1]} to ${cells.at(-1)[1]}${g.units[head] ? ` ${g.units[head]}` : ""}`];
    });
    return spans.length ? `: ${spans.join(", ")}` : "";
  }

  #values() {
    const { el } = Dom;
    const g = this.group;
    return el("div.scroll", { tabindex: 0, role: "region", "aria-label": `Values of ${g.id}` },
      el("table", {},
        el("thead", {}, el("tr", {}, g.heads.map((head) => el("th", { scope: "col" }, g.units[head] ? `${head} (${g.units[head]})` : head)))),
        el("tbody", {}, g.rows.map((row) => el("tr", {}, row.map((cell, i) => el(i < 2 ? "td" : "td.value", {}, cell)))))));
  }
}
