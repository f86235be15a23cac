// @ts-check
"use strict";
// The interactive part of the report. Creates the components, ties them to the state and handles keys.

const Report = (() => {
  const WIDE = "(min-width: 1000px)"; // wide enough for list and experiment, as in report.css
  const find = (id) => document.getElementById(id);

  /** The run folder as commands name it; the page's location if it was opened from disk. */
  function runFolder() {
    const path = decodeURIComponent(location.pathname);
    const match = location.protocol === "file:" && /^(.*)\/report\/[^/]*$/.exec(path);
    if (!match) return "DIR";
    return /^[\w./-]+$/.test(match[1]) ? match[1] : `'${match[1].replaceAll("'", "'\\''")}'`;
  }

  /** Create the page's components and tie them to its state. */
  async function start() {
    const data = await Packed.read("table");
    const facts = JSON.parse(find("facts").textContent);
    const table = new Rows.Table(data, facts.meanings), state = new State(() => view.update()), search = find("search");
    const heat = new HeatMap(find("heat"), find("measure"), table, state, facts);
    const filters = new Filters(find("facets"), find("chips"), table, state);
    const grid = new Grid(find("grid"), table, state, facts.metrics);
    const columns = new Columns(search.parentElement, grid, state);
    const actions = { move: (by) => grid.move(by), close: () => view.close(), place: () => grid.placeOf(state.experiment) };
    const experiment = new Experiment(find("experiment"), table, state, { ...facts, run: facts.series.alone ? () => "DIR" : runFolder }, actions);
    const values = new ValuePanel(find("value-plots"), table, state, facts);
    new FamilyPanel(find("family-plots"), table, state, facts);
    const view = viewOf({ table, state, search, heat, filters, grid, columns, experiment, values });
    searching(search, state);
    keyboard({ grid, experiment, search, close: view.close });
    links(grid, () => state.experiment && view.close());
    matchMedia(WIDE).addEventListener("change", view.arrange);
    addEventListener("beforeprint", () => grid.print(true));
    addEventListener("afterprint", () => grid.print(false));
    view.update();
    document.documentElement.dataset.ready = "yes";
    if (facts.worst) new FirstScreen(find("worst-replay"), table, facts);
  }

  function searching(search, state) {
    let typing = null;
    search.addEventListener("input", () => {
      clearTimeout(typing);
      typing = setTimeout(() => state.set({ query: search.value.trim() }, { replace: true }), 120);
    });
    search.parentElement.append(Dom.copyButton(() => location.href, "Copy link to this view"));
  }

  /** A text with the number of experiments that match a state, and with the names in the state that do not exist. */
  function foundText(table, state, count) {
    const all = table.count.toLocaleString("en");
    const noun = `experiment${table.count === 1 ? "" : "s"}`, countText = state.isFiltered ? `${count.toLocaleString("en")} of ${all} ${noun}` : `${all} ${noun}`;
    const listed = table.of > table.count ? ` listed, the worst of ${table.of.toLocaleString("en")}` : "";
    const unknown = table.unknown(state), reasons = table.count && !count && !unknown.length ? table.nothing(state) : [];
    return [countText + listed, ...missing(table, state), ...unknown, ...reasons].join(". ");
  }

  /** The message for an open experiment that is not listed. */
  function missing(table, { experiment }) {
    if (table.of === table.count || !experiment || table.find(experiment) >= 0) return [];
    return [`Experiment ${experiment} is not listed here. Run mutator show ${experiment} --run ${runFolder()}`];
  }

  /** Make the function that shows the state in all components. */
  function viewOf({ table, state, search, heat, filters, grid, columns, experiment, values }) {
    let drawn = null;
    let scrolled = 0; // scroll position before an experiment was opened
    let opener = null; // the plot from which it was opened

    /** Show the state. Rows are searched and sorted again only if their inputs changed. */
    function update() {
      const key = JSON.stringify([state.query, [...state.chosen].map(([n, v]) => [n, [...v]]), state.sort, state.heat, state.columns]);
      if (key !== drawn) {
        drawn = key;
        const { rows, apart, counts } = table.filter(state.query, state.chosen, HeatMap.FREE);
        grid.show(table.sort(rows, state.order.replace("-", ""), state.order.startsWith("-")));
        heat.show(apart);
        filters.show(counts);
        columns.show();
        find("found").textContent = foundText(table, state, rows.length);
        if (search.value !== state.query) search.value = state.query;
      } else grid.show(grid.rows);
      values.show();
      arrange();
    }

    /** Show the open experiment next to the list, or on the full page on a narrow screen. */
    function arrange() {
      const isOpen = Boolean(state.experiment), wasOpen = experiment.isOpen;
      if (isOpen && !wasOpen) {
        scrolled = scrollY;
        opener = document.activeElement?.closest("#value-plots, #family-plots") ? document.activeElement : null;
      }
      document.body.classList.toggle("has-experiment", isOpen);
      for (const beneath of document.querySelectorAll("main, .bar")) beneath.inert = isOpen && !matchMedia(WIDE).matches;
      experiment.show();
      if (isOpen && !wasOpen) grid.reveal();
      if (!isOpen && wasOpen) scrollTo({ top: scrolled, behavior: "instant" });
    }

    function close() {
      state.set({ experiment: "" });
      if (opener) return opener.focus({ preventScroll: true });
      grid.reveal();
      grid.focus();
    }

    return { update, arrange, close };
  }

  /** Links to filters change the state; links to sections do not. */
  function links(grid, close) {
    document.addEventListener("click", (event) => {
      const link = event.target.closest('a[href^="#"]');
      if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
      const to = link.getAttribute("href").slice(1);
      if (to.includes("=")) {
        event.preventDefault();
        history.pushState(null, "", `#${to}`);
        dispatchEvent(new PopStateEvent("popstate"));
        find("experiments").scrollIntoView();
      } else if (find(to)) {
        event.preventDefault();
        if (!find("experiments").contains(find(to))) close(); // an open experiment replaces the other sections
        find(to).scrollIntoView();
        if (to === "grid") grid.focus();
      }
    });
  }

  function keyboard({ grid, experiment, search, close }) {
    const help = find("help");
    find("open-help").addEventListener("click", () => help.showModal());
    const keys = {
      j: () => grid.move(1), k: () => grid.move(-1), "/": () => search.focus(), "?": () => help.showModal(),
    };
    const inTable = {
      ArrowDown: () => grid.move(1), ArrowUp: () => grid.move(-1), PageDown: () => grid.move(12), PageUp: () => grid.move(-12),
      Home: () => grid.move(-Infinity), End: () => grid.move(Infinity), Enter: () => grid.open(grid.current), " ": () => grid.open(grid.current),
    };
    document.addEventListener("keydown", (event) => {
      if (document.querySelector("dialog[open]") || event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
      const { target, key } = event;
      const isTyping = target.matches("input[type=search], select, textarea");
      const isRow = target.matches("#grid tr") || target === find("grid");
      const isPanel = target.closest("#experiment") && !target.closest("button, a, summary, pre, code, video, .scroll"); // these use the arrow keys
      if (key === "Escape" && isTyping) target.blur();
      else if (key === "Escape" && experiment.isOpen) close();
      else if (!isTyping && keys[key]) keys[key]();
      else if (isRow && inTable[key]) inTable[key]();
      else if (isPanel && (key === "ArrowLeft" || key === "ArrowRight")) grid.move(key === "ArrowLeft" ? -1 : 1);
      else return;
      event.preventDefault();
    });
  }

  return { start };
})();

Report.start().catch((error) => {
  document.getElementById("found").textContent = `The list of experiments cannot be shown here: ${error.message}`;
  throw error;
});
