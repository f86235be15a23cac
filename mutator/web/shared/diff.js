// @ts-check
"use strict";
// Renders unified diffs in one column or two, with Python coloured and the tags of injected lines dimmed.
//
// renderDiff(element, patchText, {mode: "unified" | "split"}) replaces the content of `element`. The page's
// element `tags` has the patterns of tags (mutants/probe_contract.py: tag_words).

const Diff = (() => {
  const { el } = Dom;
  const KEYWORDS = new Set(
    ("and as assert async await break class continue def del elif else except finally for from global if import in is " +
      "lambda nonlocal not or pass raise return try while with yield True False None self").split(" "));
  const TAGS = JSON.parse(document.getElementById("tags").textContent);
  const MARK = TAGS.mark.replace(/[^\w\s]/g, "\\$&");
  const TAG = new RegExp(`${MARK}\\S+[^\\n]*$`);
  // Lines that every mutant has, because each mutant calls the probe.
  const PROBE = new RegExp(`${MARK}(?:${TAGS.probe.join("|")})\\b`);
  // In order: holes of a shape, tag of an injected line, comment, string (complete or to the end of the line), number, word.
  const REST =
    /(#[^\n]*$)|([rbfRBF]{0,2}(?:"""(?:[^"]|"(?!""))*(?:"""|$)|'''.*?(?:'''|$)|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'))|(\b\d[\w.]*(?:[eE][-+]\d+)?)|(@?\b[A-Za-z_]\w*)/;
  const TOKENS = new RegExp(`(⟨[^⟩]*⟩)|(${TAG.source})|${REST.source}`, "g");
  const CLASSES = [null, "hole", "tag", "comment", "string", "number", "word"];

  /** The files of a patch: [{path, isNew, hunks: [{head, lines: [{sign, text, old, new}]}]}]. */
  function parse(patch) {
    const files = [];
    let file = null, hunk = null, left = 0, right = 0;
    for (const line of patch.split(/\r?\n/)) {
      if (line.startsWith("diff --git ")) {
        file = { path: line.split(" b/").pop(), isNew: false, hunks: [] };
        files.push(file);
        hunk = null;
      } else if (!file) continue;
      else if (line.startsWith("@@")) {
        const [, a, b] = /^@@ -(\d+)\S* \+(\d+)/.exec(line) || [null, 1, 1];
        left = Number(a);
        right = Number(b);
        hunk = { head: line, lines: [] };
        file.hunks.push(hunk);
      } else if (!hunk) {
        if (line.startsWith("new file")) file.isNew = true;
      } else if (/^[-+ ]/.test(line)) {
        const sign = line[0];
        const old = sign === "+" ? null : left++, now = sign === "-" ? null : right++;
        hunk.lines.push({ sign, text: line.slice(1), old, new: now });
      }
    }
    return files;
  }

  /** Whether each line of a hunk begins inside a docstring, which can begin above the hunk. */
  function prose(lines) {
    const isOdd = (line) => (line.text.match(/"""/g) || []).length % 2 === 1;
    const first = lines.find(isOdd);
    // the first quotes open a docstring if text follows them; otherwise they close one
    let inside = Boolean(first) && !/^\s*[rRfFbB]*"""./.test(first.text);
    return lines.map((line) => {
      const before = inside;
      if (isOdd(line)) inside = !inside;
      return before;
    });
  }

  /** A line of Python as a list of texts and coloured elements. */
  function coloured(text) {
    const parts = [];
    let end = 0;
    for (const match of text.matchAll(TOKENS)) {
      const kind = CLASSES[match.slice(1).findIndex((g) => g !== undefined) + 1];
      const name = kind === "word" ? word(match[0]) : kind;
      if (!name) continue;
      if (match.index > end) parts.push(text.slice(end, match.index));
      parts.push(el(name === "hole" ? "mark.hole" : `span.py-${name}`, {}, match[0]));
      end = match.index + match[0].length;
    }
    if (end < text.length) parts.push(text.slice(end));
    return parts;
  }

  const word = (text) => (text.startsWith("@") ? "decorator" : KEYWORDS.has(text) ? "keyword" : null);
  const CHANGE = { "+": "added", "-": "removed", " ": "same" };

  // Numbers and signs are attributes shown by CSS, so that copied text is source only.
  const number = (n) => el("td.no", { "data-n": n ?? "" });
  const code = (line) =>
    line
      ? el(`td.code.${CHANGE[line.sign]}`, { "data-sign": line.sign }, el("code", {}, coloured(line.text)))
      : el("td.code.none");

  const unifiedRow = (line) => el(`tr.${CHANGE[line.sign]}`, {}, number(line.old), number(line.new), code(line));
  const splitRow = ([a, b]) => el("tr", {}, number(a && a.old), code(a), number(b && b.new), code(b));

  /** The lines of a hunk side by side, with removed lines next to the added lines that follow them. */
  function pairs(lines) {
    const rows = [];
    for (let i = 0; i < lines.length; ) {
      if (lines[i].sign === " ") {
        rows.push([lines[i], lines[i++]]);
        continue;
      }
      const removed = [], added = [];
      while (i < lines.length && lines[i].sign === "-") removed.push(lines[i++]);
      while (i < lines.length && lines[i].sign === "+") added.push(lines[i++]);
      for (let k = 0; k < Math.max(removed.length, added.length); k++) rows.push([removed[k] || null, added[k] || null]);
    }
    return rows;
  }

  function table(hunks, path, mode) {
    const split = mode === "split";
    const body = hunks.map((hunk) => {
      const isProse = prose(hunk.lines);
      const lines = hunk.lines.map((line, i) => ({ ...line, isProse: isProse[i] }));
      return [el("tr.hunk", {}, el("td", { colspan: split ? 4 : 3 }, hunk.head)), split ? pairs(lines).map(splitRow) : lines.map(unifiedRow)];
    });
    const widths = split ? el("colgroup", {}, ["no", "half", "no", "half"].map((name) => el(`col.${name}`))) : null;
    return el(`table.diff.${split ? "split" : "unified"}`, { "aria-label": `Changes of ${path}` }, widths, el("tbody", {}, body));
  }

  // The lines that call the probe are folded.
  const changes = (hunk) => hunk.lines.filter((line) => line.sign !== " ");
  const isProbe = (hunk) => changes(hunk).every((line) => PROBE.test(line.text));

  function sections(files, mode, isIncluded) {
    return files.map((file) => ({ ...file, hunks: file.hunks.filter(isIncluded) })).filter((file) => file.hunks.length).map((file) =>
      el("section.file", {}, el("h4.path", {}, file.path, file.isNew ? " (new file)" : ""),
        el("div.scroll", { tabindex: 0, role: "region", "aria-label": file.path }, table(file.hunks, file.path, mode))));
  }

  /** Replace the content of `element` with `patch`. */
  function render(element, patch, { mode = "unified" } = {}) {
    const files = parse(patch);
    const visible = sections(files, mode, (hunk) => !isProbe(hunk)), folded = files.flatMap((f) => f.hunks).filter(isProbe).length;
    element.replaceChildren(...visible);
    if (!files.length) element.append(el("p.quiet", {}, "The source is unchanged."));
    if (!folded) return;
    const fold = el("details", {}, el("summary.quiet", {}, `and ${folded} ${folded > 1 ? "calls" : "call"} of the probe`));
    fold.addEventListener("toggle", () => fold.append(...sections(files, mode, isProbe)), { once: true });
    element.append(fold);
  }

  /** The injected lines alone, without tags and without the lines that call the probe: [{path, lines}]. */
  function injected(patch) {
    return parse(patch).filter((file) => !file.isNew).map((file) => ({
      path: file.path,
      lines: file.hunks.flatMap((h) => h.lines)
        .filter((l) => l.sign === "+" && !PROBE.test(l.text))
        .map((l) => l.text.replace(TAG, "").trimEnd()),
    })).filter((file) => file.lines.length);
  }

  return { render, coloured, injected };
})();

const renderDiff = Diff.render;
