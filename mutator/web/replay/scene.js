// @ts-check
"use strict";
// A scene from above on a canvas: the faulty run solid, the golden run as an outline, events marked on the ground.

class ReplayScene {
  static SYMBOLS = { activation: "▲", manifest: "◆", alert: "!", defence: "■", hazard: "✕" };
  static DASH = [3, 9]; // length (m) of dash and gap of a line
  static POST = 20; // distance (m) of the posts that make motion visible
  static AT = 0.24; // position of the followed actor, as a share of the width
  static ZOOM = [3, 17]; // minimum and maximum number of pixels per metre

  constructor(tracks, series) {
    this.tracks = tracks;
    this.series = series;
    this.end = ReplayData.until(series);
    this.pins = tracks.follow < 0 ? [] : series.marks.map(([kind, t, label]) => ({ kind, t, label, ...tracks.followed("faulty", t) }));
    this.impact = series.tEnd === null ? null : tracks.contact(series.tEnd);
    this.fixed = tracks.follow < 0 ? tracks.bounds(this.end) : null;
    const across = tracks.lines.filter((line) => line.y !== null);
    this.road = across.length > 1 ? across : [];
  }

  /** Draw the time `t` into a context of `width` x `height` CSS pixels; `colours` by name. */
  draw(context, width, height, t, colours) {
    this.context = context;
    this.width = width;
    this.height = height;
    this.t = t;
    this.colours = colours;
    this.view = this.fixed ? this.#whole() : this.#following();
    context.clearRect(0, 0, width, height);
    this.#ground();
    this.tracks.lines.forEach((line) => this.#line(line));
    this.#active();
    this.pins.filter((pin) => pin.t <= t + ReplayData.TINY).forEach((pin, i) => this.#pin(pin, i));
    const golden = this.tracks.at("golden", t), faulty = this.tracks.at("faulty", t);
    faulty.filter(({ actor }) => !actor.believed).forEach((pose) => this.#solid(pose));
    golden.filter(({ actor }) => !actor.believed).forEach((pose) => this.#outline(pose, colours.golden, [], 2));
    faulty.filter(({ actor }) => actor.believed).forEach((pose) => this.#outline(pose, colours.belief, [5, 4], 1.6));
    this.#names(faulty, golden);
    if (this.impact && t >= this.series.tEnd - ReplayData.TINY) this.#burst(this.impact);
  }

  /** A fixed view of everything in the run. */
  #whole() {
    const [left, right, low, high] = this.fixed;
    const scale = Math.min(this.width / ((right - left) * 1.08 || 1), this.height / ((high - low) * 1.2 || 1));
    return { scale, x: (left + right) / 2 - this.width / 2 / scale, y: (low + high) / 2 };
  }

  /** A view that follows an actor and reaches far enough ahead to show the other actors. */
  #following() {
    const followed = this.tracks.followed("faulty", this.t), [least, most] = ReplayScene.ZOOM;
    const scale = Math.min(most, Math.max(least, ((1 - ReplayScene.AT) * this.width) / (this.tracks.reachAt(this.t) + 9)));
    const room = Math.max(0, this.height / 2 / scale - 3), beyond = Math.max(0, Math.abs(followed.y) - room);
    return { scale, x: followed.x - (ReplayScene.AT * this.width) / scale, y: Math.sign(followed.y) * beyond };
  }

  #x = (x) => (x - this.view.x) * this.view.scale;
  #y = (y) => this.height / 2 - (y - this.view.y) * this.view.scale;

  #ground() {
    const { context, colours } = this;
    context.fillStyle = this.road.length ? colours.verge : colours.ground;
    context.fillRect(0, 0, this.width, this.height);
    if (!this.road.length) return;
    const ys = this.road.map((line) => this.#y(this.tracks.acrossAt(line, this.t))), top = Math.min(...ys), bottom = Math.max(...ys);
    context.fillStyle = colours.road;
    context.fillRect(0, top, this.width, bottom - top);
    const { POST } = ReplayScene, right = this.view.x + this.width / this.view.scale;
    context.fillStyle = colours.post;
    for (let x = Math.ceil(this.view.x / POST) * POST; x < right; x += POST) {
      for (const y of [top - 5, bottom + 2]) context.fillRect(this.#x(x) - 1, y, 2, 3);
    }
  }

  #line(line) {
    const { context, view, colours } = this, { points, y, dashed } = line;
    context.strokeStyle = this.road.length ? colours.paint : colours.quiet;
    context.lineWidth = 1.6;
    context.setLineDash(dashed ? ReplayScene.DASH.map((m) => m * view.scale) : []);
    context.lineDashOffset = view.x * view.scale;
    context.beginPath();
    if (y === null) points.forEach(([px, py], i) => context[i ? "lineTo" : "moveTo"](this.#x(px), this.#y(py)));
    else {
      const at = this.#y(this.tracks.acrossAt(line, this.t));
      context.moveTo(0, at);
      context.lineTo(this.width, at);
    }
    context.stroke();
    context.setLineDash([]);
  }

  /** Draw a band along the ground that the followed actor covered while the fault was active. */
  #active() {
    const { active } = this.series;
    if (!active || this.t < active[0] || !this.pins.length) return;
    const [from, to] = [active[0], Math.min(this.t, active[1])].map((t) => this.#x(this.tracks.followed("faulty", t).x));
    if (to < 0) return;
    this.context.fillStyle = this.colours.active;
    this.context.fillRect(Math.max(0, from), this.height - 5, to - Math.max(0, from), 5);
  }

  /** A mark at the followed actor's position during an event: a line across, and its name at the bottom. */
  #pin({ kind, x, label }, i) {
    const { context, colours, height } = this, at = this.#x(x);
    if (at < 0 || at > this.width) return; // out of view, so the name would be cut off
    context.strokeStyle = colours[kind] ?? colours.ink;
    context.lineWidth = 1.4;
    context.setLineDash(kind === "hazard" ? [] : [4, 3]);
    context.beginPath();
    context.moveTo(at, 0);
    context.lineTo(at, height);
    context.stroke();
    context.setLineDash([]);
    this.#label(`${ReplayScene.SYMBOLS[kind] ?? "•"} ${label}`, at + 4, height - 12 - 15 * (i % 3), colours[kind] ?? colours.ink);
  }

  #label(text, x, y, colour, align = "left") {
    const { context, colours } = this;
    context.font = "600 11px system-ui, sans-serif";
    context.textAlign = align;
    context.lineWidth = 3;
    context.strokeStyle = colours.halo;
    context.lineJoin = "round";
    context.strokeText(text, x, y);
    context.fillStyle = colour;
    context.fillText(text, x, y);
  }

  /** Make the path of an actor's shape, `grow` pixels larger on all sides. `back`, `front` and `across` select a part, as
   *  shares of its length and width. */
  #shape({ actor, x, y, heading }, grow = 0, { back = -0.5, front = 0.5, across = 1 } = {}) {
    const { context, view } = this, long = actor.length * view.scale + 2 * grow, wide = Math.max(2, actor.width * view.scale) + 2 * grow;
    context.save();
    context.translate(this.#x(x), this.#y(y));
    context.rotate(-heading);
    context.beginPath();
    if (actor.shape === "circle") context.arc(0, 0, long / 2, 0, 2 * Math.PI);
    else context.roundRect(back * long, -0.5 * across * wide, (front - back) * long, across * wide, Math.min(long, wide) * 0.22 * (front - back));
    context.restore();
  }

  #solid(pose) {
    const { context, colours, view } = this, { actor } = pose, isOwn = this.#isOwn(pose);
    if (isOwn && this.isActive) {
      this.#shape(pose, 5);
      context.fillStyle = colours.active;
      context.fill();
    }
    this.#shape(pose);
    context.fillStyle = isOwn ? colours.faulty : colours.other;
    context.fill();
    context.lineWidth = 1;
    context.strokeStyle = colours.edge;
    context.stroke();
    // a windscreen shows the direction
    if (actor.shape !== "box" || actor.length > 4 * actor.width || actor.width * view.scale < 6) return;
    this.#shape(pose, 0, { back: 0.1, front: 0.26, across: 0.78 });
    context.fillStyle = colours.glass;
    context.fill();
  }

  #outline(pose, colour, dash, lineWidth) {
    const { context } = this;
    this.#shape(pose, 1.5);
    context.setLineDash(dash);
    context.lineWidth = lineWidth;
    context.strokeStyle = colour;
    context.stroke();
    context.setLineDash([]);
  }

  #isOwn = ({ actor }) => actor.name === (this.tracks.scene.follow || this.tracks.scene.actors[0].name);
  get isActive() {
    const { active } = this.series;
    return Boolean(active) && this.t >= active[0] - ReplayData.TINY && this.t <= active[1] + ReplayData.TINY;
  }

  /** The actors' names. What the controller believes, and the golden run's followed actor, also get a label when out of view. */
  #names(faulty, golden) {
    const { colours, width, view } = this;
    for (const pose of faulty) {
      const above = this.#y(pose.y) - (pose.actor.shape === "circle" ? pose.actor.length : pose.actor.width) / 2 * view.scale;
      const name = pose.actor.name.replaceAll("_", " ");
      if (pose.actor.believed) this.#believed(pose, name, above + pose.actor.width * view.scale + 16, faulty.find(this.#isOwn));
      else this.#label(name, this.#x(pose.x), above - 7, colours.ink, "center");
    }
    const goldenPose = golden.find(({ actor }) => actor.name === this.tracks.scene.follow), here = faulty.find(({ actor }) => actor === goldenPose?.actor);
    if (!goldenPose || !here) return;
    const x = this.#x(goldenPose.x), by = Math.abs(goldenPose.x - here.x).toFixed(0), y = this.#y(goldenPose.y) + 46; // below the actors and their names
    if (x > width) this.#label(`golden ${by} m ahead ▶`, width - 8, y, colours.goldenText, "right");
    else if (x < 0) this.#label(`◀ golden ${by} m behind`, 8, y, colours.goldenText);
  }

  /** The name of what the controller believes; if it is out of view ahead, with its distance. */
  #believed(pose, name, y, followedPose) {
    const { colours, width } = this, by = followedPose ? (pose.x - followedPose.x - (pose.actor.length + followedPose.actor.length) / 2).toFixed(0) : null;
    if (followedPose && this.#x(pose.x - pose.actor.length / 2) > width) this.#label(`${name} ${by} m ahead ▶`, width - 8, y, colours.belief, "right");
    else this.#label(name, this.#x(pose.x), y, colours.belief, "center");
  }

  /** Draw a star at the end of the drive. */
  #burst({ x, y }) {
    const { context, colours } = this, size = Math.min(28, Math.max(14, this.view.scale * 1.6));
    context.beginPath();
    for (let k = 0; k < 20; k++) {
      const far = k % 2 ? size * 0.45 : size, angle = (k * Math.PI) / 10 + 0.1;
      context[k ? "lineTo" : "moveTo"](this.#x(x) + far * Math.cos(angle), this.#y(y) + far * Math.sin(angle));
    }
    context.closePath();
    context.fillStyle = colours.burst;
    context.strokeStyle = colours.hazard;
    context.lineWidth = 2;
    context.fill();
    context.stroke();
  }
}
