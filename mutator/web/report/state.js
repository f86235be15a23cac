// @ts-check
"use strict";
// The view's state, kept in the address after #, so that it can be shared and Back works:
// #e=EXPERIMENT&q=words&kind=sensor%2Fshifted&scenario=S1,S2&sort=-t_hazard&heat=silent&cols=kind,delta_v&plot=sensor%2Fbias [m]&y=delta_v

class State {
  /** `changed(state)` is called after every change. */
  constructor(changed) {
    this.changed = changed;
    this.#read();
    addEventListener("popstate", () => this.#came());
  }

  /** A link to a section (#tables) does not change the state. */
  static isOurs(fragment) {
    return fragment === "" || fragment.includes("=");
  }

  #came() {
    if (!State.isOurs(location.hash.slice(1))) return;
    this.#read();
    this.changed(this);
  }

  #read() {
    const fragment = location.hash.slice(1);
    const valuesByName = new Map();
    for (const part of State.isOurs(fragment) ? fragment.split("&") : []) {
      const [name, value = ""] = part.split("=");
      try {
        valuesByName.set(name, value.split(",").map(decodeURIComponent));
      } catch {
        // the link was cut, so use the readable part
      }
    }
    const firstValue = (name, otherwise) => (valuesByName.get(name) || [otherwise])[0];
    this.experiment = firstValue("e", "");
    this.query = firstValue("q", "");
    this.sort = firstValue("sort", "");
    this.heat = firstValue("heat", "");
    this.columns = (valuesByName.get("cols") || []).filter(Boolean); // columns of the list; empty: the defaults
    this.plot = { fault: firstValue("plot", ""), y: firstValue("y", ""), reaction: firstValue("react", "") }; // of "Value and margin"
    this.beside = firstValue("with", ""); // the experiment with which the open one is compared
    this.chosen = new Map();
    for (const { name, none } of Rows.FACETS) {
      if (valuesByName.has(name)) this.chosen.set(name, new Set(valuesByName.get(name).map((value) => (value === "none" && none) || value)));
    }
    const names = ["e", "with", "q", "sort", "heat", "cols", "plot", "y", "react", ...Rows.FACETS.map(({ name }) => name)];
    this.unknown = [...valuesByName.keys()].filter((name) => name && !names.includes(name)); // filters that this page does not have
  }

  /** The fragment of this state; with `experiment`, that experiment is open. */
  fragment(experiment = this.experiment) {
    const parts = [];
    const add = (name, values) => parts.push(`${name}=${values.map(encodeURIComponent).join(",")}`);
    if (experiment) add("e", [experiment]);
    if (this.beside && experiment === this.experiment) add("with", [this.beside]);
    if (this.query) add("q", [this.query]);
    for (const { name } of Rows.FACETS) {
      const values = this.chosen.get(name);
      if (values && values.size) add(name, [...values].sort());
    }
    if (this.sort) add("sort", [this.sort]);
    if (this.heat) add("heat", [this.heat]);
    if (this.columns.length) add("cols", this.columns);
    for (const [name, value] of [["plot", this.plot.fault], ["y", this.plot.y], ["react", this.plot.reaction]]) if (value) add(name, [value]);
    return parts.join("&");
  }

  /** Change the state (`{query, sort, heat, columns, plot, experiment, beside}`); `replace`: Back does not stop at this step.
   *  Another experiment is not yet compared with any. */
  set(change, { replace = false } = {}) {
    if (change.experiment !== undefined && change.experiment !== this.experiment) this.beside = "";
    Object.assign(this, change);
    this.#write(replace);
  }

  /** Choose exactly these values of a facet. An empty choice selects all values. */
  choose(facets, { replace = false } = {}) {
    for (const [name, values] of Object.entries(facets)) {
      if (values.length) this.chosen.set(name, new Set(values));
      else this.chosen.delete(name);
    }
    this.#write(replace);
  }

  /** Toggle a value of a facet. */
  toggle(name, value) {
    const values = new Set(this.chosen.get(name) || []);
    if (!values.delete(value)) values.add(value);
    this.choose({ [name]: [...values] });
  }

  clear() {
    this.chosen.clear();
    this.query = "";
    this.#write(false);
  }

  /** The sort order of the list: worst first, unless the user chose a column. */
  get order() {
    return this.sort || "rank";
  }

  get isFiltered() {
    return Boolean(this.query) || [...this.chosen.values()].some((values) => values.size);
  }

  #write(replace) {
    const to = `#${this.fragment()}`;
    if (to !== (location.hash || "#")) history[replace ? "replaceState" : "pushState"](null, "", to);
    this.changed(this);
  }
}
