"use strict";
// Marks on a served page: each is sent as it is made. What the server has not confirmed waits here, through a reload and
// through a server that is gone, and is sent again. Others' marks come in by asking every few seconds.

class Outbox {
  static EVERY_MS = 5000;
  static MOST = 200; // changes in one request
  static OTHER = "its diff is another by now, load this page again";

  /** `events`: changed(ids), kept(ids), refused(id, words), conflict(id, words, item), offline(words or ""). */
  constructor(served, groups, events) {
    Object.assign(this, { served, groups, events });
    this.address = `${served.api}${served.query}`;
    this.key = `mutator-review ${this.address}`;
    this.queue = Outbox.#stored(this.key).filter((item) => groups.has(item.group));
    this.sending = null; // the promise of the request on its way
    this.isSingle = false; // one change a request, after a batch was refused
    setInterval(() => this.poll(), Outbox.EVERY_MS);
    document.addEventListener("visibilitychange", () => document.hidden || this.poll());
    this.poll();
  }

  static #stored(key) {
    try {
      const found = JSON.parse(sessionStorage.getItem(key) || "[]");
      return Array.isArray(found) ? found : [];
    } catch {
      return [];
    }
  }

  pending(id) {
    return new Set(this.queue.filter((item) => item.group === id).map((item) => item.kind));
  }

  /** Put changes [{group, kind, text}] by a reviewer into the queue and send them. */
  add(changes, by) {
    for (const change of changes) {
      const waiting = this.queue.find((item) => item.group === change.group);
      const { revision, digest } = this.groups.get(change.group);
      this.queue.push({ ...change, by, digest, seen: waiting ? waiting.seen : revision });
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
      // no room: the marks are in this page alone
    }
  }

  /** What others have done since, and what waits here sent again. */
  async poll() {
    if (document.hidden && !this.queue.length) return;
    if (this.sending) return;
    const answer = await this.#ask(this.address);
    if (!answer.data?.groups) {
      this.events.offline(this.#gone(answer));
      return;
    }
    this.events.offline("");
    if (!this.sending) this.#receive(answer.data.groups); // else older than what is being answered
    this.#flush();
  }

  #gone({ status }) {
    const waiting = this.queue.length ? ` ${this.queue.length === 1 ? "1 mark waits" : `${this.queue.length} marks wait`} in this tab and will be sent.` : "";
    if (status === 403) return `The server does not know this page any more. Open the address that it printed in another tab, and leave this one open.${waiting}`;
    return `The server does not answer${status ? ` as it should (${status})` : ""}.${waiting}`;
  }

  async #ask(address, body) {
    const post = body && { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) };
    try {
      const response = await fetch(address, { ...post, signal: AbortSignal.timeout(20_000) });
      return { status: response.status, data: await response.json().catch(() => null) };
    } catch {
      return { status: 0, data: null };
    }
  }

  #flush() {
    this.sending ??= this.#send().finally(() => {
      this.sending = null;
    });
  }

  /** Send what waits, one reviewer's marks at a time, until nothing does or the server is gone. */
  async #send() {
    while (this.queue.length) {
      const by = this.queue[0].by;
      const batch = this.queue.filter((item) => item.by === by).slice(0, this.isSingle ? 1 : Outbox.MOST);
      const changes = batch.map(({ group, kind, text }) => ({ group, kind, text }));
      const seen = Object.fromEntries(batch.map((item) => [item.group, item.seen]).reverse()); // the first mark's counts
      const digests = Object.fromEntries(batch.map((item) => [item.group, item.digest]).reverse()); // of the diffs that were shown
      const answer = await this.#ask(this.address, { changes, by, seen, digests });
      if (!this.#answered(answer, batch)) {
        this.events.offline(this.#gone(answer));
        return;
      }
    }
    this.isSingle = false;
  }

  /** Do what an answer asks for; false: there was none. */
  #answered({ status, data }, batch) {
    if (status === 200 && data?.groups) this.#saved(batch, data.groups);
    else if (status === 409 && data?.groups) this.#conflicted(batch, data);
    else if (status >= 400 && status < 500 && status !== 403 && data?.error) this.#refused(batch, Beside.words(data.error));
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
    for (const item of this.queue) if (groups[item.group] && batch.some((one) => one.group === item.group)) item.seen = groups[item.group].revision;
    this.#keep();
    this.#receive(groups, batch.map((item) => item.group));
    this.events.kept([...new Set(batch.map((item) => item.group))]);
  }

  /** Marks about groups that others have changed: told to the reviewer. The rest is sent again. */
  #conflicted(batch, { conflict, groups }) {
    const isOther = (item) => groups[item.group] && groups[item.group].digest !== item.digest;
    const stale = batch.filter((item) => groups[item.group] && (isOther(item) || groups[item.group].revision !== item.seen));
    const others = stale.filter(isOther), told = stale.length ? stale.filter((item) => !isOther(item)) : batch;
    const kept = told.filter((item) => groups[item.group] && Outbox.#isThere(item, groups[item.group]));
    const again = told.filter((item) => !kept.includes(item) && item.kind === "remark" && groups[item.group]); // adds, and overwrites nothing
    for (const item of again) item.seen = groups[item.group].revision;
    const lost = told.filter((item) => !kept.includes(item) && !again.includes(item));
    this.#drop([...kept, ...lost, ...others]);
    this.#receive(groups, batch.map((item) => item.group));
    this.events.kept(kept.map((item) => item.group));
    for (const item of others) this.events.refused(item.group, Outbox.OTHER);
    for (const item of lost) this.events.conflict(item.group, conflict, item);
  }

  /** Whether the group is as the mark wants it: the answer that said so was lost. */
  static #isThere({ kind, by, text }, { state, decision, remarks, flag }) {
    if (kind === "approve" || kind === "reject") return decision?.by === by && state === { approve: "approved", reject: "rejected" }[kind];
    if (kind === "clear") return decision === null;
    if (kind === "remark") return remarks.at(-1)?.by === by && remarks.at(-1).text === text;
    return Boolean(flag) === (kind === "flag");
  }

  /** One of a batch was refused: each is sent alone, so that the others are kept. */
  #refused(batch, error) {
    if (batch.length > 1) {
      this.isSingle = true;
      return;
    }
    this.#drop(batch);
    this.events.refused(batch[0].group, error);
  }

  /** Take over what is known of the groups; `mine` are told as changed in any case. */
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
