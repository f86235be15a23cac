// @ts-check
"use strict";
// The replay of an experiment: scene, instruments and plots at one time. The user plays, drags or steps the time.

const Replay = (() => {
  const BEFORE = 1; // the replay starts this many s before activation
  const SPOKEN = 4; // maximum number of channels in the description of a time
  const SILENCE = 500; // ms without a change of the time, after which the state is read out

  const SYMBOLS = {
    play: "M4 2l9 6-9 6z", pause: "M4 2h3v12H4zM9 2h3v12H9z", start: "M3 3h2v10H3zM13 3v10L6 8z", end: "M11 3h2v10h-2zM3 3v10l7-5z",
    back: "M11 3v10L4 8z", on: "M5 3v10l7-5z",
  };

  /** The symbol of a button, which does not depend on fonts. */
  const symbol = (name) => Dom.svg("svg", { viewBox: "0 0 16 16", width: 14, height: 14, fill: "currentColor", "aria-hidden": "true" }, Dom.svg("path", { d: SYMBOLS[name] }));

  class Player {
    /** `clock`, `axisOf(channel)` and `toggle(name)` of a channel's plot are those of all players that are shown together.
     *  `isBrief`: the scene without instruments and plots; without a scene, two plots. */
    constructor({ place, series, facts, isBrief = false, beside = null }, { clock, axisOf, toggle }) {
      this.place = place;
      this.isBrief = isBrief;
      this.gauges = /** @type {any} */ (null);
      this.plots = /** @type {any} */ (null);
      this.beside = beside;
      this.series = series;
      this.facts = facts;
      this.channels = [...series.channels].sort((a, b) => Number(b.role === "actuator") - Number(a.role === "actuator"));
      this.axisOf = axisOf;
      this.clock = clock;
      this.toggle = toggle;
      this.scene = this.#scene();
      this.#build();
      this.plots?.begin();
      new ResizeObserver(() => this.clock.redraw()).observe(this.root);
    }

    /** The scene, if the target has one and its formulas can be evaluated over this series. */
    #scene() {
      if (!this.facts.scene) return null;
      try {
        return new ReplayScene(new ReplayTracks(this.facts.scene, this.series), this.series);
      } catch (error) {
        this.missing = error.message;
        return null;
      }
    }

    #build() {
      const { el } = Dom, { clock, series } = this;
      this.bar = new ReplayBar(series, clock, (t) => this.describe(t));
      const plotting = { isPlotted: (name) => this.plots.isPlotted(name), toggle: this.toggle };
      if (!this.isBrief) this.gauges = new ReplayGauges(this.channels, this.axisOf, plotting);
      if (!this.isBrief || !this.scene) this.plots = new ReplayPlots(this.channels, this.axisOf, series, clock, (from, to) => this.bar.zoomed(from, to), { beside: this.beside, isBrief: this.isBrief });
      this.gauges?.pressed();
      this.time = el("span.now");
      this.states = el("span.states");
      this.live = el("p.visually-hidden", { "aria-live": "polite" });
      this.root = el("div.replay-player", { role: "group", "aria-label": `${this.facts.title ?? "Replay"}. Space plays and pauses, arrows step, Shift and an arrow moves a second.`,
        onkeydown: (event) => this.#key(event), onpointerdown: (event) => {
          if (!event.target.matches("canvas")) return;
          if (event.pointerType === "mouse") event.preventDefault(); // keep the focus off the page
          this.bar.element.focus({ preventScroll: true }); // so that the bar gets the keys
        } },
        el("div.stage", {}, this.#view(), el("div.state", {}, this.time, this.states)), this.#controls(), this.bar.element, this.bar.jumps,
        this.missing ? el("p.quiet", {}, `The scene cannot be drawn: ${this.missing}.`) : null,
        this.gauges?.element, this.plots?.element, this.live);
      this.place.replaceChildren(el("div.replay-box", {}, this.root));
    }

    #view() {
      if (!this.scene) return null;
      const about = this.facts.scene.actors.map(({ name, about: what }) => what || name).join(", ");
      this.canvas = Dom.el("canvas.scene", { role: "img", "aria-label": `The drive from above: ${about}. Golden run as an outline.`, onclick: () => this.clock.toggle() });
      return this.canvas;
    }

    #controls() {
      const { el } = Dom, { clock } = this;
      const button = (icon, name, todo) => el("button", { type: "button", title: name, "aria-label": name, onclick: todo }, symbol(icon));
      this.playing = el("button.play", { type: "button", onclick: () => clock.toggle() });
      const speed = el("select", { "aria-label": "Speed", onchange: () => (clock.speed = Number(speed.value)) },
        ReplayClock.SPEEDS.map((value) => el("option", { value, selected: value === 1 }, `${value}×`)));
      return el("div.controls", {}, this.playing, button("start", "To the start (Home)", () => this.#go(this.series.start)),
        button("back", "One step back (←)", () => clock.step(-1)), button("on", "One step forward (→)", () => clock.step(1)),
        button("end", "To the end of the drive (End)", () => this.#go(ReplayData.until(this.series))), speed,
        this.scene ? el("p.legend", {}, el("span.key.box-faulty"), "faulty", el("span.key.box-golden"), "golden",
          this.facts.scene.actors.some(({ believed }) => believed) ? [el("span.key.box-belief"), "what the controller believes"] : null) : null);
    }

    #go(t) {
      this.clock.pause();
      this.clock.seek(t);
    }

    #key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select")) return;
      const { clock, series, plots } = this, by = event.shiftKey ? 1 : 0;
      const keys = {
        ArrowLeft: () => (by ? this.#go(clock.t - by) : clock.step(-1)), ArrowRight: () => (by ? this.#go(clock.t + by) : clock.step(1)),
        Home: () => this.#go(series.start), End: () => this.#go(ReplayData.until(series)),
        ...(plots ? { "+": () => plots.zoom(1), "-": () => plots.zoom(-1), 0: () => plots.all(), e: () => plots.event() } : {}),
        " ": event.target.matches("button") ? null : () => clock.toggle(),
      };
      if (!keys[event.key]) return;
      keys[event.key]();
      event.preventDefault();
    }

    /** The state at a time, as text. */
    describe(t) {
      const words = [`${t.toFixed(2)} s`, ...this.#stateAt(t).map(([, text]) => text)];
      const differ = this.channels.filter((c) => !ReplayData.same(ReplayData.valueAt(c, "faulty", t), ReplayData.valueAt(c, "golden", t)));
      for (const channel of (differ.length ? differ : this.channels).slice(0, SPOKEN)) {
        const places = ReplayData.digits(this.axisOf(channel)), of = (run) => ReplayData.text(ReplayData.valueAt(channel, run, t), places);
        words.push([channel.name, of("faulty"), ReplayData.unit(channel), differ.length ? `(golden ${of("golden")})` : "", this.#besideAt(channel.name, t, places)].filter(Boolean).join(" "));
      }
      return `${words.join(", ")}${differ.length ? "" : ", same as golden"}`;
    }

    /** A channel's value in the other experiment, as text; empty without one. */
    #besideAt(name, t, places) {
      const channel = this.beside?.series.channels.find((of) => of.name === name);
      return channel ? `(${this.beside.name} ${ReplayData.text(ReplayData.valueAt(channel, "faulty", t), places)})` : "";
    }

    /** [kind, text] of each state at a time: fault active, manifested, earlier alerts and hazards, the end. */
    #stateAt(t) {
      const { active, marks, tEnd } = this.series, came = marks.filter(([, at]) => at <= t + ReplayData.TINY), states = [];
      if (active && t >= active[0] - ReplayData.TINY && t <= active[1] + ReplayData.TINY) states.push(["active", "fault active"]);
      else if (active) states.push(["idle", t < active[0] ? "fault not active yet" : "fault no longer active"]);
      for (const [kind, , label] of came) if (kind !== "activation") states.push([kind, this.#named(kind, label)]);
      if (tEnd !== null && t > tEnd + ReplayData.TINY) states.push(["after", "after the end of the drive"]);
      return states;
    }

    #named(kind, label) {
      const about = kind === "hazard" ? this.facts.hazards?.find?.(({ name }) => name === label)?.about : "";
      return about ? `${label}: ${about}` : label;
    }

    /** Draw everything at the time of the clock. */
    draw() {
      if (!this.root.isConnected) return this.clock.pause();
      const { clock, series } = this, { t, isPlaying } = clock, now = performance.now(), colours = ReplayColours.now();
      const isAfter = series.tEnd !== null && t > series.tEnd + ReplayData.TINY;
      this.root.classList.toggle("is-after", isAfter);
      if (this.scene) this.#drawScene(t, colours);
      this.plots?.draw(colours);
      this.plots?.show(now, isPlaying);
      this.gauges?.show(t, now, isPlaying);
      this.bar.show();
      this.#write(t, isPlaying);
      this.place.dispatchEvent(new CustomEvent("replay-time", { bubbles: true, detail: { t } }));
      Replay.rate = clock.rate;
      if (clock.rate) this.root.dataset.rate = clock.rate.toFixed(1);
    }

    #drawScene(t, colours) {
      const width = this.root.clientWidth, height = Math.round(Math.min(260, Math.max(200, width * 0.27)));
      if (this.drawn !== width || this.colours !== colours) {
        this.drawn = width;
        this.colours = colours;
        this.context = ReplayColours.fitted(this.canvas, width, height);
      }
      this.scene.draw(this.context, width, height, t, colours);
    }

    #write(t, isPlaying) {
      const { el } = Dom;
      this.time.textContent = `${t.toFixed(2)} s`;
      this.root.dataset.t = t.toFixed(3);
      const states = this.#stateAt(t), key = states.map(([, text]) => text).join("|");
      if (key !== this.stated) {
        this.states.replaceChildren(...states.map(([kind, text]) => {
          const [name, ...about] = text.split(/(?=: )/);
          return el(`span.chip.${kind}`, {}, name, el("span.about", {}, ...about));
        }));
        if (isPlaying && this.stated !== undefined) this.live.textContent = key.replaceAll("|", ", ");
        this.stated = key;
      }
      const action = isPlaying ? "Pause" : "Play";
      if (this.playing.dataset.told !== action) {
        this.playing.replaceChildren(symbol(isPlaying ? "pause" : "play"), ` ${action}`);
        this.playing.title = `${action} (space)`;
        this.playing.dataset.told = action; // eslint-disable-line id-denylist -- an attribute of the page
      }
      clearTimeout(this.speaking);
      if (!isPlaying) this.speaking = setTimeout(() => document.activeElement !== this.bar.element && this.#say(t), SILENCE);
    }

    /** Read the state out once the time stops changing. The bar announces its own changes. */
    #say(t) {
      const text = this.describe(t);
      if (this.root.contains(document.activeElement) && this.live.textContent !== text) this.live.textContent = text;
    }
  }

  const firstEvent = (series) => series.active?.[0] ?? series.marks[0]?.[1] ?? series.start;

  /** The clock of several series: it begins before the first event, and pauses at the end of each drive. */
  function clockOf(all, draw) {
    const start = Math.min(...all.map((series) => series.start)), steps = all.map(ReplayData.steps).reduce((most, t) => (t.length > most.length ? t : most));
    const stops = all.map(({ tEnd }) => tEnd).filter((t) => t !== null).sort((a, b) => a - b);
    return new ReplayClock({ start, end: Math.max(...all.map(({ end }) => end)), stops, steps, at: Math.max(start, Math.min(...all.map(firstEvent)) - BEFORE) }, draw);
  }

  /** Make the function that returns a channel's axis, which covers its values in all series. */
  function axesOver(all) {
    const axes = new Map(); // by name, those that were needed
    const over = (name) => all.flatMap((series) => series.channels.filter((channel) => channel.name === name).map((channel) => ReplayData.range(channel, ReplayData.until(series))))
      .reduce(ReplayData.joined);
    return ({ name }) => {
      if (!axes.has(name)) axes.set(name, over(name));
      return axes.get(name);
    };
  }

  let current = []; // the players on the page
  for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", () => current.forEach((player) => player.draw()));

  /** Fill the places of `sides`, each {place, series, facts, isBrief, beside}, with replays that share clock, axes and choice of
   *  plots. Plots also have the faulty line of the experiment `beside`, {name, series}. Returns the players, without those of
   *  series that have no channels. */
  function showTogether(sides) {
    current.forEach(({ clock }) => clock.pause());
    current = current.filter(({ place, root }) => root.isConnected && !sides.some((side) => side.place === place));
    const drawable = sides.filter(({ series }) => series.channels.length), all = drawable.map(({ series }) => series);
    for (const { place } of sides.filter((side) => !drawable.includes(side))) place.replaceChildren(Dom.el("p.quiet", {}, "The series of this experiment has no channel."));
    if (!all.length) return [];
    const players = [], toggle = (name) => players.forEach((player) => {
      player.plots.toggle(name);
      player.gauges.pressed();
    });
    const shared = { clock: clockOf(all, () => players.forEach((player) => player.draw())), axisOf: axesOver([...all, ...drawable.flatMap(({ beside }) => beside?.series ?? [])]), toggle };
    for (const side of drawable) players.push(new Player(side, shared));
    if (players.length > 1) align(players);
    current.push(...players);
    return players;
  }

  /** Let all players begin with the same plots, those of the last one, over the same time. */
  function align(players) {
    const { chosen } = players[players.length - 1].plots, views = players.map(({ plots }) => plots.view);
    const from = Math.min(...views.map((view) => view.from)), to = Math.max(...views.map((view) => view.to));
    for (const { plots, gauges } of players) {
      plots.choose(chosen);
      plots.cover(from, to);
      gauges.pressed();
    }
  }

  /** Fill `place` with the replay of a series (SeriesFile.load); `facts` has scene and hazards, and `beside` is an experiment
   *  whose faulty line the plots have, too: {name, series}. Returns the player, or null if the series has no channels. */
  const show = (place, series, facts, { isBrief = false, beside = null } = {}) => showTogether([{ place, series, facts, isBrief, beside }])[0] ?? null;

  return { show, showTogether, rate: 0 };
})();
