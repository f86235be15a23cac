// @ts-check
"use strict";
// The clock of a replay: playing, stepping and the frame rate.

class ReplayClock {
  static SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
  static CALM = 500; // ms between frames with reduced motion
  #frames = []; // times of the latest frames, ms
  #last = null; // ms, time of the previous frame while playing
  #isDue = false; // a frame is requested
  #timer = null;

  /** A clock from `start` to `end` s, which pauses at each of `stops`. It calls `draw(clock)` after every change. */
  constructor({ start, end, stops, steps, at }, draw) {
    this.start = start;
    this.end = end;
    this.stops = stops;
    this.steps = steps;
    this.draw = draw;
    this.t = at;
    this.speed = 1;
    this.isPlaying = false;
    this.rate = 0;
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
  }

  toggle() {
    if (this.isPlaying) this.pause();
    else this.play();
  }

  play() {
    if (this.isPlaying) return;
    if (this.t >= this.end - ReplayData.TINY) this.t = this.start;
    this.isPlaying = true;
    this.#last = null;
    this.#frames = [];
    if (this.calm.matches) this.#goOnCalmly();
    this.#ask();
  }

  pause() {
    if (!this.isPlaying) return; // a replay that has left the page is paused repeatedly, and must not request more frames
    this.isPlaying = false;
    this.#ask();
  }

  seek(t) {
    this.t = Math.min(this.end, Math.max(this.start, t));
    this.#ask();
  }

  /** Move by `by` samples. */
  step(by) {
    this.pause();
    const now = ReplayData.index(this.steps, this.t), isBetween = this.t - this.steps[now] > ReplayData.TINY;
    const to = now + by + (by < 0 && isBetween ? 1 : 0);
    this.seek(this.steps[Math.min(this.steps.length - 1, Math.max(0, to))]);
  }

  /** Redraw soon, because the content changed but not the time. */
  redraw() {
    this.#ask();
  }

  #ask() {
    if (this.#isDue) return;
    this.#isDue = true;
    requestAnimationFrame((now) => this.#frame(now));
  }

  #frame(now) {
    this.#isDue = false;
    const isCalm = this.calm.matches;
    if (this.isPlaying && (!isCalm || this.#last === null)) this.#advance(now);
    this.draw(this);
    if (this.isPlaying && !isCalm) this.#ask();
  }

  /** Play with reduced motion: two frames a second, without gliding. */
  #goOnCalmly() {
    clearInterval(this.#timer); // a timer can still run after a recent pause
    this.#timer = setInterval(() => {
      if (!this.isPlaying) return clearInterval(this.#timer);
      this.#advance(performance.now());
      this.#ask();
    }, ReplayClock.CALM);
  }

  #advance(now) {
    const passed = this.#last === null ? 0 : Math.min(ReplayClock.CALM, now - this.#last); // background pages get no frames
    this.#last = now;
    const from = this.t, to = Math.min(this.end, from + (passed / 1000) * this.speed);
    const stop = this.stops.map((t) => t - ReplayData.TINY).findIndex((t) => from < t && to >= t);
    this.t = this.stops[stop] ?? to;
    if (stop >= 0 || this.t >= this.end) this.isPlaying = false;
    this.#frames.push(now);
    while (now - this.#frames[0] > 1000) this.#frames.shift();
    const span = now - this.#frames[0];
    this.rate = span > 200 ? ((this.#frames.length - 1) * 1000) / span : 0;
  }
}
