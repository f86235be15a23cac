// @ts-check
"use strict";
// The positions of a scene's actors in both runs of a series, from the manifest's formulas over its channels.

class ReplayTracks {
  static REACH = { least: 25, most: 150, spread: 1.5 }; // minimum and maximum distance (m) shown ahead; time (s) over which it changes

  /** `scene` comes from the manifest (report/scenes.py); throws an Error if the series lacks one of its channels. */
  constructor(scene, series) {
    this.scene = scene;
    this.t = series.channels.length ? ReplayData.steps(series) : [0];
    const values = { golden: this.#values("golden", series), faulty: this.#values("faulty", series) };
    this.runs = { golden: this.#run(values.golden), faulty: this.#run(values.faulty) };
    this.lines = scene.lines.map((line) => ({ ...line, across: line.y === null ? null : Formula.evaluate(line.y, values.faulty) }));
    this.follow = scene.actors.findIndex((actor) => actor.name === scene.follow);
    if (this.follow >= 0) this.reach = this.#reach();
  }

  /** The channels of a run on one time axis, each computed once a formula needs it. */
  #values(run, series) {
    const values = { t: this.t };
    for (const channel of series.channels) {
      let onAxis = channel.t === this.t ? channel[run] : null;
      Object.defineProperty(values, channel.name, { get: () => (onAxis ??= this.#spread(channel, run)) });
    }
    return values;
  }

  /** A channel with fewer samples, interpolated linearly onto the common axis. */
  #spread(channel, run) {
    return Array.from(this.t, (t) => {
      const i = ReplayData.index(channel.t, t), a = channel[run][i], b = channel[run][i + 1];
      if (b === undefined || Number.isNaN(b) || t <= channel.t[i]) return t < channel.t[0] - ReplayData.TINY ? NaN : a;
      return a + ((b - a) * (t - channel.t[i])) / (channel.t[i + 1] - channel.t[i]);
    });
  }

  #run(values) {
    const of = (tree) => Formula.evaluate(tree, values);
    const ground = this.#ground(of(this.scene.speed));
    const actors = this.scene.actors.map((actor) => ({
      x: Array.from(of(actor.x), (x, i) => x + ground[i]), y: of(actor.y), heading: of(actor.heading), visible: of(actor.visible),
    }));
    return { ground, actors };
  }

  /** The distance that the origin has moved: the integrated speed. A missing speed is taken as 0. */
  #ground(speed) {
    let sum = 0;
    return Array.from(speed, (v, i) => {
      const mean = i ? (v + speed[i - 1]) / 2 : 0;
      return (sum += Number.isFinite(mean) ? mean * (i ? this.t[i] - this.t[i - 1] : 0) : 0);
    });
  }

  /** How far the view must reach ahead of the followed actor, smoothed so that zooming is not noticeable. */
  #reach() {
    const { least, most, spread } = ReplayTracks.REACH, { actors } = this.runs.faulty, followed = actors[this.follow];
    const distances = Array.from(this.t, (_, i) => this.#farthest(actors, followed, i, least, most));
    const half = Math.max(1, Math.round(spread / ((this.t[this.t.length - 1] - this.t[0]) / (this.t.length - 1) || 1)));
    const over = (values, of) => Array.from(values, (_, i) => of(values.slice(Math.max(0, i - half), i + half + 1)));
    return over(over(distances, (near) => Math.max(...near)), (near) => near.reduce((a, b) => a + b, 0) / near.length);
  }

  #farthest(actors, followed, i, least, most) {
    const ahead = actors.map(({ x, visible }, k) => (visible[i] && !this.scene.actors[k].believed ? x[i] - followed.x[i] : 0));
    return Math.max(least, ...ahead.filter((x) => x <= most));
  }

  /** The two steps around a time, and its fraction between them. */
  #around(t) {
    const i = ReplayData.index(this.t, t), next = Math.min(i + 1, this.t.length - 1);
    const part = next === i ? 0 : Math.min(1, Math.max(0, (t - this.t[i]) / (this.t[next] - this.t[i])));
    return [i, next, part];
  }

  static #between(values, near) {
    const [i, next, part] = near;
    const a = values[i], b = values[next];
    return Number.isFinite(a) && Number.isFinite(b) ? a + (b - a) * part : a;
  }

  /** The actors present at a time: {actor, x, y, heading}, in world metres. */
  at(run, t) {
    const near = this.#around(t);
    return this.runs[run].actors.flatMap(({ x, y, heading, visible }, k) => {
      if (!visible[near[0]]) return [];
      const [px, py, turned] = [x, y, heading].map((values) => ReplayTracks.#between(values, near));
      return Number.isFinite(px) && Number.isFinite(py) ? [{ actor: this.scene.actors[k], x: px, y: py, heading: turned || 0 }] : [];
    });
  }

  /** The position of the followed actor. An actor that has disappeared keeps its last position. */
  followed(run, t) {
    const { x, y } = this.runs[run].actors[this.follow];
    let near = this.#around(t);
    while (near[0] > 0 && !Number.isFinite(x[near[0]])) near = [near[0] - 1, near[0] - 1, 0];
    return { x: ReplayTracks.#between(x, near), y: ReplayTracks.#between(y, near) };
  }

  reachAt(t) {
    return ReplayTracks.#between(this.reach, this.#around(t));
  }

  acrossAt(line, t) {
    return ReplayTracks.#between(line.across, this.#around(t));
  }

  /** The bounds of a fixed view: [left, right, low, high] of all points and tracks. */
  bounds(end) {
    const last = ReplayData.index(this.t, end), xs = [], ys = [];
    for (const line of this.scene.lines) for (const [x, y] of line.points) (xs.push(x), ys.push(y));
    for (const { actors } of Object.values(this.runs)) {
      actors.forEach(({ x, y }, k) => {
        const size = Math.max(this.scene.actors[k].length, this.scene.actors[k].width) / 2;
        for (let i = 0; i <= last; i++) {
          if (Number.isFinite(x[i]) && Number.isFinite(y[i])) (xs.push(x[i] - size, x[i] + size), ys.push(y[i] - size, y[i] + size));
        }
      });
    }
    const least = (values) => values.reduce((a, b) => Math.min(a, b), Infinity), most = (values) => values.reduce((a, b) => Math.max(a, b), -Infinity);
    return [least(xs), most(xs), least(ys), most(ys)];
  }

  /** Where the followed actor touches or is nearest to another at a time; its own position if it is alone. */
  contact(t) {
    const there = this.at("faulty", t), followed = there.find(({ actor }) => actor.name === this.scene.follow) ?? there[0];
    if (!followed || this.follow < 0) return followed ?? null;
    const gap = (other) => Math.abs(other.x - followed.x) - (other.actor.length + followed.actor.length) / 2;
    const [nearest] = there.filter((other) => other !== followed && !other.actor.believed).sort((a, b) => gap(a) - gap(b));
    if (!nearest || gap(nearest) > 1) return { x: followed.x, y: followed.y };
    const side = Math.sign(nearest.x - followed.x) || 1;
    return { x: followed.x + (side * followed.actor.length) / 2, y: (followed.y + nearest.y) / 2 };
  }
}
