"""Print the CPU time of a campaign by stage, and by what spends it.

`python benchmarks/phases.py [--campaign paper] [--limit N] [--warm]`. The cache is empty, unless `--warm`.
The parts of a stage: the command; its workers; golden runs that wait in fork servers; forked runs; the rest,
which is runs on the reference engine. They come from the counters of /proc, which are read every 0.2 s. The
last moments of a process can thus count as another part.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections import defaultdict
from pathlib import Path

from against import STAGES, TICK_S

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("command", "workers", "waiting golden runs", "forked runs", "reference runs")
SAMPLE_S = 0.2


class ProcessTree:
    """The CPU time (s) of a command and its descendants, by part."""

    def __init__(self, root: int) -> None:
        self._root = root
        self._fork_servers: dict[int, tuple[float, float]] = {}  # own time, and that of ended children
        self._parents: dict[int, int] = {}  # of the processes of fork servers
        self._alive: set[int] = set()
        self._workers: dict[int, float] = {}
        self._command_s = self._total_s = 0.0
        self._lock = threading.Lock()

    def sample(self) -> dict[str, float]:
        with self._lock:
            self._read()
            waiting_s = sum(own_s for own_s, _ in self._fork_servers.values())
            named = [self._command_s, sum(self._workers.values()), waiting_s, self._forked_s()]
            return dict(zip(PARTS, [*named, self._total_s - sum(named)], strict=True))

    def _forked_s(self) -> float:
        """Return the time of ended children of fork servers, without those that waited themselves."""
        ended_servers_s: dict[int, float] = defaultdict(float)
        for pid, times in self._fork_servers.items():
            if pid not in self._alive:
                ended_servers_s[self._parents[pid]] += sum(times)
        servers = self._fork_servers.items()
        return sum(max(0.0, ended_s - ended_servers_s[pid]) for pid, (_, ended_s) in servers)

    def _read(self) -> None:
        children: dict[int, list[int]] = defaultdict(list)
        times: dict[int, tuple[float, float]] = {}
        parents: dict[int, int] = {}
        leaders: set[int] = set()  # of sessions
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
            except OSError:  # it has just ended
                continue
            pid, ticks = int(path.parent.name), [int(field) for field in fields[11:15]]
            children[int(fields[1])].append(pid)
            parents[pid] = int(fields[1])
            if int(fields[3]) == pid:
                leaders.add(pid)
            times[pid] = (TICK_S * sum(ticks[:2]), TICK_S * sum(ticks[2:]))
        self._alive = set(times)
        todo, total = [self._root], 0.0
        while todo:
            pid = todo.pop()
            todo += children[pid]
            if pid in times:
                total += sum(times[pid])
                self._note(pid, parents[pid], pid in leaders, *times[pid])
        self._total_s = max(self._total_s, total)

    def _note(
        self, pid: int, parent: int, leads_session: bool, own_s: float, ended_children_s: float
    ) -> None:
        try:
            words = Path(f"/proc/{pid}/cmdline").read_text()
        except OSError:
            return
        if pid == self._root:
            self._command_s = own_s
        elif "fork_server.py" in words:
            # a forked run leads a session, as do the guard and the first process of its server
            is_forked_run = leads_session and self._parents.get(parent) in self._fork_servers
            if not is_forked_run:
                self._fork_servers[pid], self._parents[pid] = (own_s, ended_children_s), parent
        elif "run_once.py" not in words:
            self._workers[pid] = own_s


def measure(command: list[str], env: dict[str, str]) -> dict[str, dict[str, float]]:
    """Run a command that names its stages. Return the CPU time (s) of each by part."""
    used = {stage: dict.fromkeys(PARTS, 0.0) for stage in STAGES}
    stage, before = STAGES[0], dict.fromkeys(PARTS, 0.0)
    with subprocess.Popen(
        command, cwd=ROOT, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        tree, is_over = ProcessTree(process.pid), threading.Event()

        def sample_regularly() -> None:
            while not is_over.wait(SAMPLE_S):
                tree.sample()

        sampler = threading.Thread(target=sample_regularly)
        sampler.start()
        assert process.stderr is not None
        for line in process.stderr:
            begun = next((name for name in STAGES if line.startswith(name)), stage)
            if begun != stage:
                now = tree.sample()
                for part in PARTS:
                    used[stage][part] += now[part] - before[part]
                stage, before = begun, now
        now = tree.sample()
        for part in PARTS:
            used[stage][part] += now[part] - before[part]
        is_over.set()
        sampler.join()
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return used


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--campaign", default="paper")
    parser.add_argument("--limit", metavar="N", help="run only N experiments of the campaign")
    parser.add_argument("--workers", default="2")
    parser.add_argument("--warm", action="store_true", help="use the caches of this machine")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, "-m", "mutator", "run", options.campaign, "--no-reuse"]
        command += ["--out", f"{place}/run", "-n", options.workers]
        command += ["--limit", options.limit] if options.limit else []
        env = os.environ | ({} if options.warm else {"XDG_CACHE_HOME": f"{place}/cache"})
        used = measure(command, env)
    print(f"{'CPU s':14}" + "".join(f"{part:>21}" for part in PARTS) + f"{'all':>10}")
    for stage in STAGES:
        figures = [used[stage][part] for part in PARTS]
        print(f"{stage:14}" + "".join(f"{seconds:21.1f}" for seconds in figures) + f"{sum(figures):10.1f}")
    figures = [sum(used[stage][part] for stage in STAGES) for part in PARTS]
    print(f"{'whole':14}" + "".join(f"{seconds:21.1f}" for seconds in figures) + f"{sum(figures):10.1f}")
    if options.json:
        options.json.write_text(json.dumps(used, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
