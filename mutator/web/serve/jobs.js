// @ts-check
"use strict";
// The server's jobs on every served page: progress, cancel, log and result. The server keeps the list, so it
// survives a reload. The first page can start and cancel any job, the others only their own.

const Jobs = (() => {
  const { el } = Dom;
  const SOON_MS = 1000, LATER_MS = 5000, MOST_SHOWN = 20;
  const ACTIVE = ["queued", "running"];
  const token = document.querySelector('meta[name="mutator-page"]').content; // says which page sends a request
  const [, kind, run] = location.pathname.split("/");
  const mayCancel = (job) => !kind || (kind === "trial" ? job.kind === "try" : job.run === decodeURIComponent(run ?? ""));
  const isActive = (job) => ACTIVE.includes(job.state);
  const rows = new Map(); // job id -> row
  const watchers = [];
  let place = null, timer = null, latestJobs = [];

  /** A server error as text. */
  const words = ({ got, where, expected, remedy }) =>
    [where ? `${where}: ${got}` : got, expected && `expected ${expected}`, remedy].filter(Boolean).join("; ");

  /** The server's answer. Throws an Error with a readable message if the server refuses or is unreachable. */
  async function ask(address, body) {
    const post = body && { method: "POST", headers: { "Content-Type": "application/json", "X-Mutator-Page": token }, body: JSON.stringify(body) };
    let response;
    try {
      response = await fetch(address, post);
    } catch {
      throw new Error("no answer from the server");
    }
    const data = await response.json().catch(() => null);
    if (response.ok && data) return data;
    throw new Error(data?.error ? words(data.error) : `the server answered ${response.status}`);
  }

  /** Start a job and return its id. */
  async function start(body) {
    const { id } = await ask("/api/jobs", body);
    await poll();
    return id;
  }

  /** Call `onJobs(jobs)` with the jobs, newest first, after each request for the list. */
  function watch(onJobs) {
    watchers.push(onJobs);
    onJobs(latestJobs);
  }

  async function poll() {
    clearTimeout(timer);
    try {
      latestJobs = (await ask("/api/jobs")).jobs;
      show(latestJobs);
      for (const watcher of watchers) watcher(latestJobs);
      tell("");
    } catch (error) {
      tell(`The jobs cannot be shown: ${error.message}.`);
    }
    timer = setTimeout(poll, latestJobs.some(isActive) ? SOON_MS : LATER_MS);
  }

  function tell(text) {
    const message = place.querySelector(".jobs-said");
    if (message.textContent !== text) message.textContent = text;
    if (text) place.hidden = false;
  }

  function show(jobs) {
    place.hidden = jobs.length === 0 && !place.dataset.always;
    const active = jobs.filter(isActive).length, failed = jobs.filter((job) => job.state === "failed").length;
    const waiting = active ? `${active} unfinished` : "none unfinished";
    place.querySelector(".jobs-count").textContent = `${jobs.length} in total, ${waiting}${failed ? `, ${failed} failed` : ""}`;
    place.querySelector(".jobs-none").hidden = jobs.length > 0;
    const list = place.querySelector("ul"), newest = jobs.slice(0, MOST_SHOWN);
    for (const [id, row] of rows) {
      if (newest.some((job) => job.id === id)) continue;
      row.element.remove();
      rows.delete(id);
    }
    newest.forEach((job, at) => {
      if (!rows.has(job.id)) rows.set(job.id, rowOf(job.id));
      const row = rows.get(job.id);
      row.update(job);
      if (list.children[at] !== row.element) list.insertBefore(row.element, list.children[at] || null);
    });
  }

  /** The row of a job. It stays the same element, so that its buttons keep the focus. */
  function rowOf(id) {
    const state = el("span.job-state"), title = el("b"), progress = el("progress", { max: 1 }), message = el("span.quiet"), result = el("a");
    const button = (text, onclick) => el("button", { type: "button", onclick }, text);
    const cancel = button("Cancel", () => ask(`/api/jobs/${id}/cancel`, {}).then(poll, (error) => (message.textContent = error.message)));
    const log = button("Log", () => showLog(id, title.textContent));
    result.addEventListener("click", opened);
    function update(job) {
      state.textContent = job.state;
      state.className = `job-state ${job.state}`;
      title.textContent = job.title;
      cancel.setAttribute("aria-label", `Cancel ${job.title}`);
      log.setAttribute("aria-label", `Log of ${job.title}`);
      progress.hidden = job.state !== "running";
      progress.setAttribute("aria-label", `Progress of ${job.title}`);
      if (job.progress === null) progress.removeAttribute("value");
      else progress.value = job.progress;
      message.textContent = job.message;
      cancel.hidden = !isActive(job) || !mayCancel(job);
      const address = job.result || (job.kind === "campaign" && isActive(job) && mayCancel(job) && `/live/${encodeURIComponent(job.run)}`);
      result.hidden = !address || (!job.result && address === location.pathname);
      result.textContent = job.result ? "Show it" : "Watch it";
      result.setAttribute("aria-label", `${result.textContent}: ${job.title}`);
      if (address) result.href = address;
    }
    return { element: el("li", {}, state, title, progress, message, el("span.job-do", {}, result, cancel, log)), update };
  }

  /** If a link leads to the open page, reload the page, because the job rebuilt its report. */
  function opened(event) {
    const to = new URL(event.currentTarget.href);
    if (to.pathname !== location.pathname) return;
    event.preventDefault();
    history.replaceState(null, "", to);
    location.reload();
  }

  async function showLog(id, title) {
    const dialog = document.getElementById("job-log"), text = dialog.querySelector("pre");
    dialog.querySelector("h2").textContent = title;
    text.textContent = "…";
    dialog.showModal();
    for (;;) {
      const answer = await ask(`/api/jobs/${id}/log`).catch((error) => ({ log: error.message }));
      const isAtEnd = text.scrollTop + text.clientHeight >= text.scrollHeight - 4;
      if (text.textContent !== answer.log) text.textContent = answer.log || "Nothing has been printed yet.";
      if (isAtEnd) text.scrollTop = text.scrollHeight;
      const job = latestJobs.find((listed) => listed.id === id);
      await new Promise((resolve) => setTimeout(resolve, SOON_MS));
      if (!dialog.open || !job || !isActive(job)) return;
    }
  }

  /** Put the list into the section `jobs`, if the page has it, or into a bar at the bottom. */
  function install() {
    const section = document.getElementById("jobs");
    place = section || el("aside.jobs", { id: "jobs", "aria-label": "Jobs", hidden: true });
    if (section) section.dataset.always = "yes";
    const list = [el("ul"), el("p.quiet.jobs-none", {}, "No jobs since the server was started.")];
    const count = el("span.quiet.jobs-count");
    place.classList.add("jobs");
    place.append(...(section ? [el("h2", {}, "Jobs ", count), ...list]
      : [el("details", { open: innerWidth > 700 }, el("summary", {}, el("b", {}, "Jobs"), " ", count, " ", el("a", { href: "/" }, "All runs and reviews")), ...list)]),
      el("p.jobs-said", { role: "status" }));
    if (!section) document.body.append(place);
    document.body.append(el("dialog", { id: "job-log", "aria-labelledby": "job-log-title" }, el("h2", { id: "job-log-title" }),
      el("pre", { tabindex: 0 }), el("form", { method: "dialog" }, el("button", {}, "Close"))));
    poll();
  }

  install();
  return { ask, start, watch };
})();
