// @ts-check
"use strict";
// The values of a series (SeriesFile.load) for the replay: at a time, as text, or on an axis.

const ReplayData = (() => {
  const BEYOND = 100; // an axis is cut at this multiple of the channel's usual size
  const TINY = 1e-9; // s

  /** The index of the last of `times` that is not after `t`; 0 before the first. */
  function index(times, t) {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t + TINY) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** The value of a channel in a run (`golden` or `faulty`) at a time: the last sample; NaN if there is none. */
  const valueAt = (channel, run, t) => (channel.t.length && t >= channel.t[0] - TINY ? channel[run][index(channel.t, t)] : NaN);

  const same = (a, b) => a === b || (Number.isNaN(a) && Number.isNaN(b));

  /** The times at which a replay can change: those of the channel with the most samples. */
  const steps = (series) => series.channels.reduce((most, { t }) => (t.length > most.length ? t : most), []);

  /** The time (s) of the end of the drive. */
  const until = (series) => series.tEnd ?? series.end;

  /** The largest difference between golden and faulty up to the end of the drive: {by, t}; `by` is 0 if they are equal. */
  function largest(channel, end) {
    const difference = { by: 0, t: NaN };
    for (let i = 0; i < channel.t.length && channel.t[i] <= end + TINY; i++) {
      const by = Math.abs(channel.faulty[i] - channel.golden[i]);
      if (by > difference.by) Object.assign(difference, { by, t: channel.t[i] });
      else if (!difference.by && !same(channel.faulty[i], channel.golden[i])) Object.assign(difference, { by: NaN, t: channel.t[i] });
    }
    return difference;
  }

  /** The root mean square difference between golden and faulty, from activation to the end of the drive, as a share of the axis.
   *  Where only one of them has a value, the difference is the whole axis. */
  function apart(channel, { low, high }, begin, end) {
    let sum = 0, count = 0;
    for (let i = index(channel.t, begin); i < channel.t.length && channel.t[i] <= end + TINY; i++, count++) {
      const by = same(channel.faulty[i], channel.golden[i]) ? 0 : Math.abs(channel.faulty[i] - channel.golden[i]) / (high - low);
      sum += Math.min(1, Number.isFinite(by) ? by : 1) ** 2;
    }
    return Math.sqrt(sum / (count || 1));
  }

  /** The axis of a channel, from its values up to the end of the drive. `cut`: the true range, if it is too large to show.
   *  For example, a headway time near standstill would hide everything else. `isWhole`: all values are integers. */
  function range(channel, end) {
    const values = [];
    for (let i = 0; i < channel.t.length && channel.t[i] <= end + TINY; i++) values.push(channel.golden[i], channel.faulty[i]);
    const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
    if (!sorted.length) return { low: 0, high: 1, cut: null, isWhole: true };
    const isWhole = sorted.every(Number.isInteger);
    let low = sorted[0], high = sorted[sorted.length - 1], cut = null;
    const sizes = sorted.map(Math.abs).sort((a, b) => a - b), usual = Math.max(1, sizes[Math.floor(0.98 * (sizes.length - 1))]);
    if (Math.max(-low, high) > BEYOND * usual) {
      cut = [low, high];
      [low, high] = [Math.max(low, -2 * usual), Math.min(high, 2 * usual)];
    }
    // a narrower range would magnify rounding errors
    const margin = Math.max((high - low) * 0.06, 1e-6, Math.abs(high) * 1e-3);
    return { low: low - margin, high: high + margin, cut, isWhole };
  }

  /** The axis that covers two axes. */
  const joined = (a, b) => ({ low: Math.min(a.low, b.low), high: Math.max(a.high, b.high), isWhole: a.isWhole && b.isWhole,
    cut: a.cut && b.cut ? [Math.min(a.cut[0], b.cut[0]), Math.max(a.cut[1], b.cut[1])] : a.cut ?? b.cut });

  /** About `count` round numbers that label an axis from `low` to `high`. */
  function ticks(low, high, count) {
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) || 10), numbers = [];
    for (let k = Math.ceil(low / step - TINY); k * step <= high + step * TINY; k++) numbers.push(Number((k * step).toPrecision(12)));
    return numbers;
  }

  /** The number of decimals for a channel with this axis. */
  function digits({ low, high, isWhole }) {
    if (isWhole) return 0;
    const size = Math.max(Math.abs(low), Math.abs(high), 1e-9);
    return Math.min(4, Math.max(0, (size < 1 ? 3 : 4) - Math.ceil(Math.log10(size))));
  }

  /** A value as text, with a true minus sign, which is as wide as a plus. */
  function text(value, places) {
    if (Number.isNaN(value)) return "–";
    if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
    const formatted = Math.abs(value) >= 1e6 ? value.toExponential(1) : value.toFixed(places);
    return (Number(formatted) === 0 ? formatted.replace("-", "") : formatted).replace("-", "−");
  }

  const unit = (channel) => (channel.unit && channel.unit !== "-" ? channel.unit.replace("^2", "²").replace("^3", "³") : "");

  return { TINY, index, valueAt, same, steps, until, largest, apart, range, joined, ticks, digits, text, unit };
})();
