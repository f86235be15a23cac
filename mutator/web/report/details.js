// @ts-check
"use strict";
// Diff, spec and trigger of each experiment, assembled from shared parts (report/browse.py: details).

class Details {
  static #promise = null;

  /** The details that the page contains. They are unpacked only once. */
  static read() {
    Details.#promise ??= Packed.read("details").then((data) => new Details(data));
    return Details.#promise;
  }

  constructor(data) {
    this.data = data;
    // the members of a shape are in row order
    const memberCounts = new Uint32Array(data.shapes.length);
    this.member = data.shape.map((shape) => (shape < 0 ? -1 : memberCounts[shape]++));
  }

  /** The diff of a row: its shape with the row's values in the holes; null: no diff. */
  patch(row) {
    const shape = this.data.shapes[this.data.shape[row]];
    if (!shape) return null;
    const values = shape.values.map((hole) => hole[this.member[row]]);
    return shape.parts.map((part, i) => part + (i < shape.places.length ? values[shape.places[i]] : "")).join("");
  }

  /** The start of the digest of a row's trace, which its series must name. */
  trace(row) {
    return this.data.trace[row];
  }

  spec(row) {
    return this.data.specs[this.data.spec[row]] ?? null;
  }

  setting(row) {
    return this.data.settings[this.data.setting[row]] ?? null;
  }
}
