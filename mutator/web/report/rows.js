// @ts-check
"use strict";
// The results as columns. For 100,000 experiments, search, counts and sorting take less time than passes between two keystrokes.

const Rows = (() => {
  /** The filters: column, title, the name of an empty cell and, for cells with several values, the separator. */
  const FACETS = [
    { name: "kind", title: "Fault type" },
    { name: "module", title: "Module" },
    { name: "scenario", title: "Scenario" },
    { name: "method", title: "Method" },
    { name: "trigger", title: "Trigger" },
    { name: "outcome", title: "Outcome", none: "no outcome" },
    { name: "status", title: "Status" },
    { name: "golden_class", title: "Golden run", show: (value) => value.replaceAll("_", " ") },
    { name: "against_golden", title: "Against golden", none: "not compared", show: (value) => value.replaceAll("_", " ") },
    { name: "severity", title: "Severity", none: "no class", show: (value) => (value === "no class" ? `${value}, any outcome` : value) },
    { name: "hazards", title: "Hazard", between: ";", none: "no hazard" },
    { name: "alerts", title: "Alert", between: ";", none: "no alert" },
    { name: "warning", title: "Alert in time", none: "no hazard" },
    { name: "reached", title: "Fault reached", none: "nothing" },
    { name: "stopped_at", title: "Fault stopped at", between: ";", none: "not stopped" },
    { name: "through", title: "Link passed", between: ";", none: "no link" },
  ];
  const OF_COMPONENTS = ["reached", "stopped_at", "through"];
  const SEARCHED = ["experiment_id", "fault", "kind", "variant", "value", "unit", "scenario", "concrete_scenario", "method", "trigger", "condition",
    "ending", "outcome", "severity", "hazards", "alerts", "warning", "detail"];
  const SEARCHED_PARTS = "its id, fault, value, scenario, trigger, outcome, severity, hazards, alerts or error";
  const SILENT = ["no alert at all", "alert only after the hazard"]; // hazards without an alert before them

  const COMPARISON = /^([a-z]\w*)(<=|>=|<|>|=)(.+)$/; // smallest_ttc<1, severity>=S2
  const COMPARED = { "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b, "=": (a, b) => a === b };

  const number = (value) => (value === null ? NaN : Number(value)); // infinite values are strings

  /** A column: `text(row)`, `number(row)` (NaN: empty), and `words` with `codes` if it has a dictionary. */
  function column({ name, words, codes, texts, numbers }) {
    if (numbers) {
      return { name, numbers, number: (row) => number(numbers[row]), text: (row) => (numbers[row] === null ? "" : String(numbers[row])) };
    }
    if (texts) return { name, texts, number: () => NaN, text: (row) => texts[row] };
    return { name, words, codes, number: () => NaN, text: (row) => words[codes[row]] };
  }

  /** A facet's values, and which of them each word of its column has. */
  function facet(of, columns) {
    const column = columns.get(of.name);
    if (!column || !column.words) return null;
    const split = column.words.map((word) => (word ? (of.between ? word.split(of.between) : [word]) : [of.none || ""]));
    const values = [...new Set(split.flat())].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
    const at = new Map(values.map((value, i) => [value, i]));
    return { ...of, codes: column.codes, values, at, members: split.map((s) => [...new Set(s)].map((v) => at.get(v))) };
  }

  class Table {
    constructor(data, meanings = {}) {
      this.count = data.count;
      this.checked = data.checked; // the hazards that were checked
      this.labels = data.labels; // labels of components
      this.severities = data.severities || {}; // severity classes in words, by name
      this.of = data.of || data.count; // number of experiments of the run; for a large run the page lists only the worst
      this.map = data.map || null; // of all experiments, if not all are listed (report/whole_map.py)
      this.families = data.families || []; // of the scenarios: names and parameters
      this.columns = new Map(data.columns.map((c) => [c.name, column(c)]));
      this.facets = FACETS.map((of) => facet(of, this.columns)).filter(Boolean);
      this.meanings = meanings; // by column and code
      this.byId = null;
      this.phrases = null;
      const unusable = ["harness_error", "invalid_mutant", "left_out", "not_judged"];
      const marks = ["status", "outcome"].map((name) => this.columns.get(name)).filter((of) => of && of.words)
        .map(({ words, codes }) => ({ codes, unusable: words.map((word) => unusable.includes(word)) }));
      // Counts leave out experiments without a valid result.
      this.usable = (row) => !marks.some(({ codes, unusable: isUnusable }) => isUnusable[codes[row]]);
    }

    text(row, name) {
      const column = this.columns.get(name);
      return column ? column.text(row) : "";
    }

    /** The scenario of a row: `S1`, or family and values, `follow, ego 60 km/h, gap 20 m`. */
    scenario(row) {
      const name = this.text(row, "scenario"), family = this.families.find((each) => each.name === name);
      if (!family || this.text(row, "family") !== name) return name;
      return [name, ...family.parameters.map((parameter) => this.parameter(row, parameter))].join(", ");
    }

    /** The scenario of a row as commands name it: `S1`, or `follow:ego_kph=60,gap_m=20`. */
    scenarioArgument(row) {
      const name = this.text(row, "scenario"), family = this.families.find((each) => each.name === name);
      if (!family || this.text(row, "family") !== name) return name;
      return `${name}:${family.parameters.map(({ key }) => `${key}=${this.text(row, key)}`).join(",")}`;
    }

    /** A parameter's value in a row, with name and unit: `ego 60 km/h`. */
    parameter(row, { key, name, unit }) {
      const value = this.number(row, key);
      return `${name} ${Number.isNaN(value) ? this.text(row, key) : Number(value.toPrecision(6))}${unit ? ` ${unit}` : ""}`;
    }

    /** The text that shows a value of a column. Components have labels, and severity classes have words. */
    called(name, text) {
      if (name === "severity") return this.severities[text] || text;
      return OF_COMPONENTS.includes(name) ? text.replace(/[^;→]+/g, (part) => this.labels[part] || part).replaceAll("→", " → ").replaceAll(";", ", ") : text;
    }

    /** What a code in a column means, such as `S3` in `scenario`; null if the page knows none. Codes are separated by `;`. */
    meaning(name, code) {
      const meanings = this.meanings[name] ?? {};
      return String(code).split(";").map((part) => meanings[part]).filter(Boolean).join("; ") || null;
    }

    number(row, name) {
      const column = this.columns.get(name);
      return column ? column.number(row) : NaN;
    }

    /** The row of an experiment, by its id or a unique prefix; -1 if there is none. */
    find(id) {
      const ids = this.columns.get("experiment_id");
      this.byId ??= new Map(Array.from({ length: this.count }, (_, row) => [ids.text(row), row]));
      if (this.byId.has(id)) return this.byId.get(id);
      const begun = id.length >= 4 ? [...this.byId.keys()].filter((key) => key.startsWith(id)) : [];
      return begun.length === 1 ? this.byId.get(begun[0]) : -1;
    }

    /** A function of the row: whether a searched column contains `token`. */
    #has(name, token) {
      const column = this.columns.get(name);
      if (!column) return null;
      if (column.words) {
        const hit = column.words.map((word) => this.#fits(name, word, token));
        return hit.includes(true) ? (row) => hit[column.codes[row]] : null;
      }
      if (name === "experiment_id" && !/^[0-9a-f]+$/.test(token)) return null;
      return (row) => column.text(row).toLowerCase().includes(token);
    }

    /** Whether `token` finds a word of a column, as the page shows it. */
    #fits(name, word, token) {
      const none = FACETS.find((facet) => facet.name === name)?.none;
      if (!word) return token === none;
      // Only as a whole: "alert" must not find "no alert at all", nor "S2" a severity.
      if (name === "warning") return token === word || (token === "silent" && SILENT.includes(word));
      if (name === "severity") {
        const label = this.called(name, word).toLowerCase();
        return token === label || label.replace(` (severity ${word.toLowerCase()})`, "").includes(token);
      }
      return [word, word.replaceAll("_", " ")].some((text) => text.toLowerCase().includes(token));
    }

    /** The words of a query; phrases in quotes and names of several words that the page shows, such as `no alert`, are one. */
    #tokens(query) {
      if (!this.phrases) {
        const searched = this.facets.filter((facet) => SEARCHED.includes(facet.name));
        const names = searched.flatMap((facet) => facet.values.map((value) => this.called(facet.name, value).replaceAll("_", " ").toLowerCase()));
        const several = [...new Set(names)].filter((text) => text.includes(" ")).sort((a, b) => b.length - a.length);
        const escaped = several.map((text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
        this.phrases = new RegExp(`"([^"]+)"|(?<!\\S)(?:${escaped.join("|") || "(?!)"})(?!\\S)|\\S+`, "g");
      }
      return [...query.toLowerCase().matchAll(this.phrases)].map(([token, quoted]) => quoted || token);
    }

    /** `smallest_ttc<1` as a function of the row; null: not a comparison with a column. An empty cell matches only `=none`. */
    #comparison(token) {
      const [, name, sign, operand] = COMPARISON.exec(token) || [];
      const column = this.columns.get(name), compare = COMPARED[sign];
      if (!column) return null;
      if (sign === "=" && operand === "none") return (row) => column.text(row) === "" || column.text(row) === "none";
      if (column.numbers) return Number.isNaN(Number(operand)) ? null : (row) => compare(column.number(row), Number(operand));
      return (row) => column.text(row) !== "" && compare(column.text(row).toLowerCase(), operand);
    }

    /** The rows that have all words of `query` in any column and satisfy its comparisons; null: no query. */
    #searched(query) {
      const tokens = this.#tokens(query);
      if (!tokens.length) return null;
      const tests = tokens.map((token) => {
        const fits = this.#comparison(token);
        return fits ? [fits] : SEARCHED.map((name) => this.#has(name, token)).filter(Boolean);
      });
      const matches = new Uint8Array(this.count);
      for (let row = 0; row < this.count; row++) {
        matches[row] = tests.every((any) => any.some((has) => has(row))) ? 1 : 0;
      }
      return matches;
    }

    /**
     * The rows that match `query` and `chosen` (facet name -> set of values).
     * `counts` has the number of rows for each facet value, given the other facets' choices.
     * `apart` has the rows that match all facets except perhaps those in `free`. A map over these facets counts them.
     */
    filter(query, chosen, free = []) {
      const matches = this.#searched(query);
      const tests = this.facets.map((f) => {
        const chosenValues = chosen.get(f.name);
        if (!chosenValues || !chosenValues.size) return null;
        return Uint8Array.from(f.members, (has) => (has.some((value) => chosenValues.has(f.values[value])) ? 1 : 0));
      });
      const counts = this.facets.map((f) => new Uint32Array(f.values.length));
      const isFree = this.facets.map((f) => free.includes(f.name));
      const rows = [], apart = [];
      for (let row = 0; row < this.count; row++) {
        if (matches && !matches[row]) continue;
        let failed = 0, where = -1, failedFixed = 0;
        for (let i = 0; i < tests.length; i++) {
          if (tests[i] && !tests[i][this.facets[i].codes[row]]) {
            failed++;
            where = i;
            if (!isFree[i]) failedFixed++;
          }
        }
        if (!failedFixed) apart.push(row);
        if (!failed) rows.push(row);
        if (failed > 1) continue;
        for (let i = 0; i < counts.length; i++) {
          if (failed && i !== where) continue;
          for (const value of this.facets[i].members[this.facets[i].codes[row]]) counts[i][value]++;
        }
      }
      return { rows, apart, counts: new Map(this.facets.map((f, i) => [f.name, counts[i]])) };
    }

    /** Sentences about a state's unknown columns and filters, and about filters for values that these results lack. */
    unknown({ query, chosen, unknown }) {
      const sentences = unknown.map((name) => `This page has no filter "${name}"`);
      for (const token of this.#tokens(query)) {
        const [, name] = COMPARISON.exec(token) || [];
        if (name && !this.columns.has(name)) sentences.push(`There is no column "${name}" to search`);
      }
      for (const [name, values] of chosen) {
        const facet = this.facets.find((f) => f.name === name);
        if (facet && [...values].some((value) => facet.at.has(value))) continue;
        sentences.push(`No experiment has ${name} ${[...values].map((value) => `"${value}"`).join(" or ")}`);
      }
      return sentences;
    }

    /** Why no row matches a query and chosen values. */
    nothing({ query, chosen }) {
      const isEmpty = (matches) => matches && !matches.includes(1);
      const words = this.#tokens(query).filter((token) => !COMPARISON.test(token) && isEmpty(this.#searched(`"${token}"`)));
      if (words.length) return words.map((word) => `No experiment has "${word}" in ${SEARCHED_PARTS}`);
      if (isEmpty(this.#searched(query))) return ["Each part of the search finds experiments, but none has all of them"];
      return chosen.size ? ["No experiment has all of the chosen values" + (query ? " and matches the search" : "")] : [];
    }

    /** `rows` sorted by a column: text alphabetically, numbers by size, empty cells last; the sort is stable. */
    sort(rows, name, descending) {
      const column = this.columns.get(name);
      if (!column) return rows;
      const turn = descending ? -1 : 1;
      const key = new Float64Array(this.count);
      if (column.numbers) for (let row = 0; row < this.count; row++) key[row] = column.number(row);
      else {
        const texts = column.words || column.texts;
        const order = texts.map((_, i) => i).sort((a, b) => texts[a].localeCompare(texts[b], "en", { numeric: true }));
        const rank = new Float64Array(texts.length);
        order.forEach((at, i) => (rank[at] = texts[at] === "" ? NaN : i));
        for (let row = 0; row < this.count; row++) key[row] = rank[column.words ? column.codes[row] : row];
      }
      const empty = (row) => Number.isNaN(key[row]);
      return [...rows].sort((a, b) => Number(empty(a)) - Number(empty(b)) || (empty(a) ? a - b : turn * (key[a] - key[b]) || a - b));
    }
  }

  return { Table, FACETS };
})();
