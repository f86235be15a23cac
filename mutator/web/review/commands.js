// @ts-check
"use strict";
// Turns the marks on a page without a server into commands that record the decisions.

class Commands {
  /** `changed(ids)` is called with the ids of the groups whose marks changed. */
  constructor(data, changed) {
    this.data = data;
    this.changed = changed;
    this.marks = new Map(); // group id -> "approve" or "reject", in the order of marking
    for (const id of ["by", "remark", "reason"]) document.getElementById(id).addEventListener("input", () => this.#show());
  }

  pending(id) {
    return new Set(this.marks.has(id) ? [this.marks.get(id)] : []);
  }

  /** Mark groups. Marking a single group again removes its mark. */
  mark(ids, kind) {
    if (!["approve", "reject"].includes(kind)) return false;
    const isOff = ids.length === 1 && this.marks.get(ids[0]) === kind;
    for (const id of ids) {
      this.marks.delete(id);
      if (!isOff) this.marks.set(id, kind);
    }
    this.changed(ids);
    this.#show();
    return true;
  }

  #show() {
    const { el, copyButton } = Dom;
    document.getElementById("decide").hidden = this.marks.size === 0;
    const by = Commands.quoted(document.getElementById("by").value.trim() || "NAME");
    const option = (name) => {
      const text = document.getElementById(name).value.trim();
      return text && `--${name} ${Commands.quoted(text)}`;
    };
    document.getElementById("commands").replaceChildren(...["approve", "reject"].flatMap((kind) => {
      const ids = [...this.marks].filter(([, k]) => k === kind).map(([id]) => id);
      if (!ids.length) return [];
      const parts = ["mutator review", kind, ...ids, this.data.options, `--by ${by}`, option("remark"), kind === "reject" && option("reason")];
      const text = parts.filter(Boolean).join(" ");
      return [el("div.command", {}, el("code", {}, text), copyButton(() => text))];
    }));
  }

  /** An argument quoted for a shell. */
  static quoted(text) {
    return /^[\w.@/-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
  }
}
