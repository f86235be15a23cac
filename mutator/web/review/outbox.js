// @ts-check
"use strict";
// Sends each mark on a served page as soon as it is made. Unconfirmed marks survive reloads and server restarts and are
// sent again. Every few seconds, asks the server for marks of other reviewers.

class Outbox {
  static EVERY_MS = 5000;
  static MOST = 200; // changes per request
  static OTHER = "the diff of this group has changed, so reload this page";

  /** `events`: changed(ids), saved(ids), refused(id, words), conflict(id, words, item), offline(words or ""). */
  constructor(served, groups, events) {
    this.served = served;
    this.groups = groups;
    this.events = events;
    this.address = `${served.api}${served.query}`;
    this.key = `mutator-review ${this.address}`;
    this.queue = Outbox.#stored(this.key).filter((item) => groups.has(item.group));
    this.sending = null; // promise of the pending request
    this.sends = 0;
    this.isSingle = false; // one change per request, because a batch was refused
    setInterval(() => this.poll(), Outbox.EVERY_MS);
    document.addEventListener("visibilitychange", () => document.hidden || this.poll());
    this.poll();
  }

  static #stored(key) {
    try {
      const items = JSON.parse(sessionStorage.getItem(key) || "[]");
      return Array.isArray(items) ? items : [];
    } catch {
      return [];
    }
  }

  pending(id) {
    return new Set(this.queue.filter((item) => item.group === id).map((item) => item.kind));
  }

  /** Queue the changes of a reviewer, [{group, kind, text}], and send them. */
  add(changes, by) {
    for (const change of changes) {
      const waiting = this.queue.find((item) => item.group === change.group);
      const { revision, digest } = this.groups.get(change.group);
      this.queue.push({ ...change, by, digest, seen: waiting ? waiting.seen : revision }); // eslint-disable-line id-denylist -- a key of stored marks
    }
    this.#keep();
    this.events.changed(changes.map((change) => change.group));
    this.#flush();
  }

  #keep() {
    try {
      if (this.queue.length) sessionStorage.setItem(this.key, JSON.stringify(this.queue));
      else sessionStorage.removeItem(this.key);
    } catch {
      // the storage is full, so only this page has the marks
    }
  }

  /** Fetch the changes of others, and resend what is waiting. */
  async poll() {
    if (document.hidden && !this.queue.length) return;
    if (this.sending) return;
    const { sends } = this;
    const answer = await this.#ask(this.address);
    if (!answer.data?.groups) {
      this.events.offline(this.#offlineText(answer));
      return;
    }
    this.events.offline("");
    if (sends === this.sends) this.#receive(answer.data.groups); // otherwise, marks sent since might be missing from the answer
    this.#flush();
  }

  #offlineText({ status }) {
    const waiting = this.queue.length ? ` ${this.queue.length === 1 ? "1 mark waits" : `${this.queue.length} marks wait`} in this tab and will be sent.` : "";
    if (status === 403) return `The server no longer knows this page. In another tab, open the address that the server printed, and keep this tab open.${waiting}`;
    return `${status ? `Unexpected answer from the server (${status})` : "The server does not answer"}.${waiting}`;
  }

  async #ask(address, body) {
    const post = body && { method: "POST", headers: { "content-type": "application/json", "x-mutator-page": this.served.token }, body: JSON.stringify(body) };
    try {
      const response = await fetch(address, { ...post, signal: AbortSignal.timeout(20_000) });
      return { status: response.status, data: await response.json().catch(() => null) };
    } catch {
      return { status: 0, data: null };
    }
  }

  #flush() {
    if (this.sending || !this.queue.length) return;
    this.sends += 1;
    this.sending = this.#send().finally(() => {
      this.sending = null;
    });
  }

  /** Send the waiting marks, by reviewer, until none are left or the server is unreachable. */
  async #send() {
    while (this.queue.length) {
      const by = this.queue[0].by;
      const batch = this.queue.filter((item) => item.by === by).slice(0, this.isSingle ? 1 : Outbox.MOST);
      const changes = batch.map(({ group, kind, text }) => ({ group, kind, text }));
      const revisions = Object.fromEntries(batch.map((item) => [item.group, item.seen]).reverse()); // of the group's first mark in the batch
      const digests = Object.fromEntries(batch.map((item) => [item.group, item.digest]).reverse()); // of the shown diffs
      const answer = await this.#ask(this.address, { changes, by, seen: revisions, digests }); // eslint-disable-line id-denylist -- a key of the request
      if (!this.#answered(answer, batch)) {
        this.events.offline(this.#offlineText(answer));
        return;
      }
    }
    this.isSingle = false;
  }

  /** Process an answer. Returns false if there was none. */
  #answered({ status, data }, batch) {
    if (status === 200 && data?.groups) this.#saved(batch, data.groups);
    else if (status === 409 && data?.groups) this.#conflicted(batch, data);
    else if (status === 403 && data?.error) location.reload(); // the server was restarted: a new page sends the marks
    else if (status >= 400 && status < 500 && data?.error) this.#refused(batch, Beside.words(data.error));
    else return false;
    this.events.offline("");
    return true;
  }

  #drop(items) {
    this.queue = this.queue.filter((item) => !items.includes(item));
    this.#keep();
  }

  #saved(batch, groups) {
    this.#drop(batch);
    for (const item of this.queue) if (groups[item.group] && batch.some((sent) => sent.group === item.group)) item.seen = groups[item.group].revision; // eslint-disable-line id-denylist -- a key of stored marks
    this.#keep();
    this.#receive(groups, batch.map((item) => item.group));
    this.events.saved([...new Set(batch.map((item) => item.group))]);
  }

  /** Tell the reviewer which marks were not saved because somebody else changed the group, and resend the rest. */
  #conflicted(batch, { conflict, groups }) {
    const isOther = (item) => groups[item.group] && groups[item.group].digest !== item.digest;
    const stale = batch.filter((item) => groups[item.group] && (isOther(item) || groups[item.group].revision !== item.seen));
    const others = stale.filter(isOther), conflicting = stale.length ? stale.filter((item) => !isOther(item)) : batch;
    const saved = conflicting.filter((item) => groups[item.group] && Outbox.#isThere(item, groups[item.group]));
    const again = conflicting.filter((item) => !saved.includes(item) && item.kind === "remark" && groups[item.group]); // a remark overwrites nothing
    for (const item of again) item.seen = groups[item.group].revision; // eslint-disable-line id-denylist -- a key of stored marks
    const lost = conflicting.filter((item) => !saved.includes(item) && !again.includes(item));
    this.#drop([...saved, ...lost, ...others]);
    this.#receive(groups, batch.map((item) => item.group));
    this.events.saved(saved.map((item) => item.group));
    for (const item of others) this.events.refused(item.group, Outbox.OTHER);
    for (const item of lost) this.events.conflict(item.group, conflict, item);
  }

  /** Whether the group already has the mark's state because an answer was lost. */
  static #isThere({ kind, by, text }, { state, decision, remarks, flag }) {
    if (kind === "reject" && (decision?.reason ?? "") !== text) return false;
    if (kind === "approve" || kind === "reject") return decision?.by === by && state === { approve: "approved", reject: "rejected" }[kind];
    if (kind === "clear") return decision === null;
    if (kind === "remark") return remarks.at(-1)?.by === by && remarks.at(-1).text === text;
    return Boolean(flag) === (kind === "flag");
  }

  /** After a refused batch, send each mark alone, so that valid marks are saved. */
  #refused(batch, error) {
    if (batch.length > 1) {
      this.isSingle = true;
      return;
    }
    this.#drop(batch);
    this.events.refused(batch[0].group, error);
  }

  /** Apply the state of the groups. Always report `mine` as changed. */
  #receive(groups, mine = []) {
    const changed = new Set(mine);
    for (const [id, now] of Object.entries(groups)) {
      const group = this.groups.get(id);
      if (!group) continue;
      const isOther = Boolean(now.digest) && now.digest !== group.digest; // the target, a template or the library has changed
      if (group.revision === now.revision && group.state === now.state && Boolean(group.isOther) === isOther) continue;
      const { state, decision, remarks, flag, revision } = now;
      Object.assign(group, { state, decision, remarks, flag, revision, isOther });
      changed.add(id);
    }
    if (changed.size) this.events.changed([...changed].filter((id) => this.groups.has(id)));
  }
}
