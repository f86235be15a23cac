// @ts-check
"use strict";
// Reads the series of experiments (format series/1): channels over time, golden and faulty. Chunks are scripts in the
// run's folder series/, because a page opened from disk can load only scripts. A page can also contain them.

const SeriesFile = (() => {
  const FOLDER = "../series/", CHUNKS = 6; // CHUNKS: chunks kept in memory
  const waiting = new Map(); // file name -> function that gets its text
  const chunks = new Map(); // name -> promise of its bytes, most recently used last
  const goldens = new Map(); // entry -> promise of a golden run
  let index = null; // promise of the index
  const SIGN = 0x7fffffff, NONE = 0x7fc00000; // NONE: the bits of a missing value

  /** Each file calls this function with the file's name and text. */
  function loaded(name, text) {
    waiting.get(name)?.(text);
  }

  /** The bytes of a file; null if it does not exist, an error if it is damaged. */
  function read(path, name) {
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.charset = "x-user-defined"; // one character per byte
      script.src = `${FOLDER}${path}.js`;
      const finish = (what, value) => {
        waiting.delete(name);
        script.remove();
        what(value);
      };
      waiting.set(name, (text) => {
        const bytes = new Uint8Array(text.length);
        for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
        finish(resolve, bytes);
      });
      script.addEventListener("error", () => finish(resolve, null));
      script.addEventListener("load", () => waiting.has(name) && finish(reject, damaged(`series/${path}.js`)));
      document.head.append(script);
    });
  }

  const missing = (name) => Object.assign(new Error(`series/${name}.js is missing`), { isMissingFile: true });

  const damaged = (what) => new Error(`${what} is damaged`);

  async function inflated(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer(); // this also verifies the checksum
  }

  /** The index, with the function `find(id)`: the places {name, at, size} of an experiment's entry and of its golden run, and the
   *  golden run's number; null if there is no series of it. Null if the file is not there. */
  async function readIndex() {
    const bytes = await read("index", "index");
    if (!bytes) return null;
    const data = JSON.parse(new TextDecoder().decode(await inflated(bytes)));
    if (data.schema !== "series/1") throw new Error(`unknown series schema ${data.schema}`);
    const keys = Object.keys(data.goldens).sort(); // sorted, because numeric names would come first
    return { find: (id) => {
      const row = rowOf(data.ids, id);
      if (row < 0) return null;
      const reference = data.goldens[keys[data.golden_of[row]]];
      return { entry: placeOf(data, sum(data.entries, 0, row + 1)), golden: placeOf(data, reference), reference };
    } };
  }

  const sum = (numbers, from, to) => {
    let total = 0;
    for (let i = from; i < to; i++) total += numbers[i];
    return total;
  };

  /** The position of an id of 16 characters in a text of ids; -1 if it is not there. */
  function rowOf(ids, id) {
    let at = id.length === 16 ? ids.indexOf(id) : -1;
    while (at >= 0 && at % 16) at = ids.indexOf(id, at + 1); // the end of an id and the begin of the next
    return at < 0 ? -1 : at / 16;
  }

  /** The place of an entry: the chunk's name, the entry's first byte in it and its size. */
  function placeOf({ chunks: counts, sizes }, entry) {
    let first = 0; // entry of the chunk
    for (const [name, count] of counts) {
      if (entry < first + count) return { name, at: sum(sizes, first, entry), size: sizes[entry] };
      first += count;
    }
    throw new Error(`the index has no entry ${entry}`);
  }

  async function bytesOf({ name, at, size }) {
    const promise = chunks.get(name) || read(name, name);
    chunks.delete(name);
    chunks.set(name, promise);
    if (chunks.size > CHUNKS) chunks.delete(chunks.keys().next().value);
    const bytes = await promise;
    if (!bytes) throw missing(name);
    return bytes.subarray(at, at + size);
  }

  const ordered = (word) => word ^ ((word >> 31) & SIGN);

  /** A run as store/series_format.py writes it: { about, t, every, rows, points }. `rows` has a row for each channel
   *  of the golden run; `every` gives its spacing in samples. */
  async function decoded(bytes, golden) {
    const raw = await inflated(bytes), view = new DataView(raw);
    const text = 4 + view.getUint32(0, true), about = JSON.parse(new TextDecoder().decode(new Uint8Array(raw, 4, text - 4)));
    const { known: commonCount, more, changed, points } = about, doubles = new Float64Array(raw.slice(text, text + 8 * (more + points.length)));
    const t = new Float64Array(commonCount + more), every = golden ? golden.every : about.every;
    if (golden) t.set(golden.t.subarray(0, commonCount));
    t.set(doubles.subarray(0, more), commonCount);
    const words = unplaned(new Uint8Array(raw, text + doubles.byteLength));
    const rows = every.map((step, channel) => {
      const values = new Float32Array(new Int32Array(Math.ceil(t.length / step)).fill(NONE).buffer);
      if (golden) values.set(golden.rows[channel].subarray(0, Math.ceil(commonCount / step)));
      return values;
    });
    let at = 0;
    for (const channel of changed) {
      change(new Int32Array(rows[channel].buffer), words.subarray(at));
      at += rows[channel].length;
    }
    if (words.length !== at + 2 * points.length) throw new Error("the number of values does not match");
    const exact = new Float32Array(words.buffer, 4 * at);
    return { about, t, every, rows, points: points.map((channel, i) => ({ channel, t: doubles[more + i], golden: exact[i], faulty: exact[points.length + i] })) };
  }

  /** Words stored by byte: all first bytes, then all second ones, and so on. */
  function unplaned(planes) {
    const count = planes.length / 4, words = new Int32Array(count);
    for (let i = 0; i < count; i++) words[i] = planes[i] | (planes[count + i] << 8) | (planes[2 * count + i] << 16) | (planes[3 * count + i] << 24);
    return words;
  }

  /** Turn golden values, as bits, into those of the faulty run. */
  function change(bits, words) {
    for (let i = 0, step = 0, apart = 0; i < bits.length; i++) {
      step = (step + ((words[i] >>> 1) ^ -(words[i] & 1))) | 0;
      apart = (apart + step) | 0;
      bits[i] = ordered((ordered(bits[i]) + apart) | 0);
    }
  }

  /** A channel's golden and faulty values at the same times, with the points in between. Channels without such points share
   *  the array of their times; `timesEvery(step)` returns it. */
  function together(golden, run, channel, timesEvery) {
    const t = timesEvery(golden.every[channel]), between = run.points.filter((p) => p.channel === channel), length = t.length + between.length;
    const joined = { t: between.length ? new Float64Array(length) : t, golden: new Float32Array(length), faulty: new Float32Array(length) };
    const setStep = (k, time, goldenValue, faultyValue) => {
      if (between.length) joined.t[k] = time;
      joined.golden[k] = goldenValue;
      joined.faulty[k] = faultyValue;
    };
    const goldenRow = golden.rows[channel], faultyRow = run.rows[channel];
    let k = 0, next = 0;
    for (let i = 0; i < t.length; i++) {
      for (; next < between.length && between[next].t < t[i]; next++) setStep(k++, between[next].t, between[next].golden, between[next].faulty);
      setStep(k++, t[i], i < goldenRow.length ? goldenRow[i] : NaN, i < faultyRow.length ? faultyRow[i] : NaN);
    }
    for (; next < between.length; next++) setStep(k++, between[next].t, between[next].golden, between[next].faulty);
    return joined;
  }

  function marks({ active, manifest, alerts, hazards, defences = [] }) {
    const eventMarks = [...alerts.map(([name, t]) => ["alert", t, name]), ...hazards.map(([name, t]) => ["hazard", t, name])];
    for (const [name, t] of defences) eventMarks.push(["defence", t, `${name} acts`]);
    if (active) eventMarks.push(["activation", active[0], "activated"]);
    if (manifest !== null) eventMarks.push(["manifest", manifest, "manifested"]);
    return eventMarks.sort((a, b) => a[1] - b[1]);
  }

  const ROUNDING = 2 ** -19, SMALLEST = 1e-37, LARGEST = 3e38; // as in store/series_record_check.py

  /** Whether a channel deviates by `largest` at most and, unless it has times of its own, at least. */
  function deviates(golden, run, channel, largest) {
    if (largest > LARGEST && largest < Infinity) return true; // too large for single precision
    let low = 0, high = golden.about.channels[channel].own_times ? Infinity : 0;
    const add = (goldenValue, faultyValue) => {
      const same = goldenValue === faultyValue || (Number.isNaN(goldenValue) && Number.isNaN(faultyValue)), gap = same ? 0 : Math.abs(goldenValue - faultyValue);
      const by = Number.isNaN(gap) ? Infinity : gap, size = ROUNDING * (Math.abs(goldenValue) + Math.abs(faultyValue)) + SMALLEST;
      const rounding = Number.isFinite(size) ? size : 0;
      low = Math.max(low, by - rounding);
      high = Math.max(high, by + rounding);
    };
    const goldenRow = golden.rows[channel], faultyRow = run.rows[channel];
    for (let i = 0; i < Math.min(goldenRow.length, faultyRow.length); i++) add(goldenRow[i], faultyRow[i]);
    for (const p of run.points) if (p.channel === channel) add(p.golden, p.faulty);
    return low <= largest && largest <= high;
  }

  /** The data of a replay. `expected` has what the record says: the start of the digest of its `trace`, and the `largest` deviation
   *  of each compared channel. A series that does not match is an error. */
  function buildSeries(id, expected, golden, run) {
    const { about } = run, { channels } = golden.about, names = channels.map(({ name }) => name);
    const matches = expected.trace && about.trace?.startsWith(expected.trace)
      && run.t.every((t, i) => i >= golden.t.length || t === golden.t[i])
      && Object.entries(expected.largest).every(([name, by]) => names.includes(name) && deviates(golden, run, names.indexOf(name), by));
    if (!matches) throw new Error("it belongs to another run than the record");
    const { t } = run.t.length > golden.t.length ? run : golden, times = new Map();
    const timesEvery = (step) => {
      if (!times.has(step)) times.set(step, step === 1 ? t : t.filter((_, i) => i % step === 0));
      return times.get(step);
    };
    return {
      id, start: golden.about.start, end: about.end, tEnd: about.t_end, active: about.active, marks: marks(about),
      channels: channels.map((channel, i) => ({ ...channel, ...together(golden, run, i, timesEvery) })),
    };
  }

  /** The series that the page contains: { runs, of }, texts in base64 and the numbers of each experiment's golden and faulty
   *  one; null if it contains none. A page alone contains those of the worst; another page that of the worst one only. */
  const embedded = (() => {
    let data; // parsed on first use
    return () => (data === undefined ? (data = JSON.parse(document.getElementById("embedded-series")?.textContent ?? "null")) : data);
  })();

  const decodedText = (text, golden) => decoded(Uint8Array.from(atob(text), (character) => character.charCodeAt(0)), golden);

  /** A series in texts, { runs, of }. `decodedGoldens` keeps golden runs for the other experiments. */
  async function readTexts({ runs, of }, id, expected, decodedGoldens) {
    if (!Object.hasOwn(of, id)) return null;
    const [reference, entry] = of[id];
    const key = `embedded ${reference}`;
    if (!decodedGoldens.has(key)) decodedGoldens.set(key, decodedText(runs[reference], null));
    const golden = await decodedGoldens.get(key);
    return buildSeries(id, expected, golden, await decodedText(runs[entry], golden));
  }

  /** The two runs in the file of one rerun experiment. */
  async function readKept(id, expected) {
    const bytes = await read(`kept/${id}`, id);
    if (!bytes) return null;
    const length = new DataView(bytes.buffer).getUint32(0, true), golden = await decoded(bytes.subarray(4, 4 + length), null);
    return buildSeries(id, expected, golden, await decoded(bytes.subarray(4 + length), golden));
  }

  async function findSeries(id, expected, isNew) {
    const there = JSON.parse(document.getElementById("facts").textContent).series; // so that no missing files are requested
    const isInside = !isNew && embedded() && Object.hasOwn(embedded().of, id);
    if (isInside || !there || there.alone) return readTexts(embedded(), id, expected, goldens); // a page of a comparison has no files either
    if (isNew || there.kept.includes(id)) { // from a rerun, perhaps because the packed series is damaged
      const series = await readKept(id, expected);
      if (series) return series;
    }
    if (there.packed) index ??= readIndex();
    if (there.packed && !(await index)) throw missing("index");
    const located = (await index)?.find(id);
    if (!located) return null;
    const { reference } = located;
    if (!goldens.has(reference)) goldens.set(reference, bytesOf(located.golden).then((bytes) => decoded(bytes, null)));
    const golden = await goldens.get(reference);
    return buildSeries(id, expected, golden, await decoded(await bytesOf(located.entry), golden));
  }

  /** The series of an experiment; null if there is none. Rejects with a message if it is damaged or does not match
   *  what the record says: `expected`, {trace, largest}. `isNew`: the series can be newer than this page. `texts`: it is in
   *  these texts, as in a page alone. */
  async function load(id, expected, { isNew = false, texts = null } = {}) {
    try {
      return await (texts ? readTexts(texts, id, expected, new Map()) : findSeries(id, expected, isNew));
    } catch (error) {
      throw new Error(`The series of ${id} cannot be read: ${error.message}`, { cause: error });
    }
  }

  return { load, loaded };
})();
