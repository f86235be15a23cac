// @ts-check
"use strict";
// Stacks the groups of one template in one function under the first of them, until the user opens the stack.

class Stacks {
  static LISTED = 6; // members named in a closed stack

  /** `cards`: group id -> Card, in the order of the page; `actions`: mark(ids, kind), unfold(id). */
  constructor(cards, actions) {
    this.cards = cards;
    this.actions = actions;
    this.open = new Set(); // the numbers (`like`) of open stacks
    this.members = new Map(); // first id -> ids of the others
  }

  /** Stack the shown groups (ids, in order) under the first of their kind. Returns the groups that stay visible. */
  fold(ids) {
    this.members.clear();
    let first = null;
    for (const id of ids) {
      if (first && this.cards.get(first).group.like === this.cards.get(id).group.like) this.members.get(first).push(id);
      else this.members.set((first = id), []);
    }
    const visible = new Set();
    for (const [id, others] of this.members) {
      visible.add(id);
      if (this.isOpen(id)) others.forEach((other) => visible.add(other));
    }
    for (const [id, card] of this.cards) this.#show(card, this.members.get(id) || []);
    return visible;
  }

  isOpen(id) {
    return this.open.has(this.cards.get(id).group.like);
  }

  /** The first group of the stack that contains this group, and the others. */
  of(id) {
    for (const [first, others] of this.members) if (first === id || others.includes(id)) return [first, ...others];
    return [id];
  }

  toggle(id) {
    const { like } = this.cards.get(id).group;
    if (!this.open.delete(like)) this.open.add(like);
  }

  #show(card, others) {
    const { el } = Dom;
    const { id } = card.group, place = card.element.querySelector(":scope > .alike"), isOpen = this.isOpen(id);
    place.hidden = others.length === 0;
    if (!others.length) return;
    const had = place.contains(document.activeElement) && document.activeElement.dataset.do;
    const button = (name, key, text, onclick, more = {}) => el("button", { type: "button", "data-do": name, title: `Key ${key}`, onclick, ...more }, text);
    place.replaceChildren(
      el("p", {}, button("unfold", "o", isOpen ? "Fold them" : `${others.length} more like this`, () => this.actions.unfold(id), { "aria-expanded": String(isOpen) }), " ",
        button("approve", "s", `Approve all ${others.length + 1}`, () => this.actions.mark([id, ...others], "approve"))),
      isOpen ? "" : el("ul", {}, this.#lines(id, others)));
    if (had) place.querySelector(`[data-do="${had}"]`).focus();
  }

  #lines(id, others) {
    const { el } = Dom;
    const texts = Stacks.differences([id, ...others].map((member) => this.cards.get(member).group.injections.join("; "))).slice(1);
    const lines = others.slice(0, Stacks.LISTED).map((other, i) => {
      const { state } = this.cards.get(other).group;
      return el("li", {}, el("span.quiet", {}, other), " ", el(`span.state.${state}`, {}, state), ` ${texts[i]}`);
    });
    return others.length > lines.length ? [...lines, el("li.quiet", {}, `and ${others.length - lines.length} more`)] : lines;
  }

  /** Each text without the words that all texts have in common at the beginning and at the end. */
  static differences(texts) {
    const all = texts.map((text) => text.split(" ")), [first] = all;
    const shortest = Math.min(...all.map((words) => words.length));
    let begin = 0, end = 0;
    while (begin < shortest && all.every((words) => words[begin] === first[begin])) begin++;
    while (end < shortest - begin && all.every((words) => words.at(-1 - end) === first.at(-1 - end))) end++;
    return all.map((words) => words.slice(begin, words.length - end).join(" ") || "the same place");
  }
}
