// @ts-check
"use strict";
// A diff of diffs: what a reviewer saw against the current state. Each line has a sign and, where the content is a diff,
// that diff's sign too.

const Changes = (() => {
  const { el } = Dom;
  const KINDS = { "+": "added", "-": "removed", " ": "same" };

  /** The rows of a unified diff without its two header lines. */
  function rows(text) {
    const lines = text.split("\n");
    const first = lines.findIndex((line) => line.startsWith("@@"));
    return lines.slice(Math.max(first, 0)).filter((line) => line && !line.startsWith("\\")).map((line) => {
      if (line.startsWith("@@")) return el("tr.hunk", {}, el("td", {}, line));
      const kind = KINDS[line[0]] || "same";
      return el(`tr.${kind}`, {}, el(`td.code.${kind}`, { "data-sign": line[0] }, el("code", {}, inner(line.slice(1)))));
    });
  }

  /** A coloured line. A leading sign is that of the inner diff. `-- ` marks a heading. */
  function inner(text) {
    const sign = /^[-+](?!-{1,2} |\+{2} )/.exec(text);
    return sign ? [el(`span.inner.${KINDS[sign[0]]}`, {}, sign[0]), ...Diff.coloured(text.slice(1))] : Diff.coloured(text);
  }

  /** Show the changes in `place`. */
  function render(place, text) {
    place.replaceChildren(text
      ? el("div.file", {}, el("div.scroll", { tabindex: 0, role: "region", "aria-label": "Changed since the decision" },
        el("table.diff.changes", {}, el("tbody", {}, rows(text)))))
      : el("p.quiet", {}, "What the reviewer saw was not saved, so it cannot be compared."));
  }

  return { render };
})();
