"""A bench that is killed again and again gives the same seal as one that is left alone, and the page *Ask in
batches* keeps its word.
"""

import json
import os
import random
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import mutator
from mutator.store.records import load_records
from mutator.workspace import Workspace

_CLONE = Path(__file__).parents[2]
_PAGE = _CLONE / "docs" / "how-to" / "ask-in-batches.md"
_KILLS = 8
_ASK = """
import sys
import mutator

library, out, workers, size = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
workspace = mutator.Workspace.find(root=library)
with mutator.open_bench(workspace, out, campaign="small", workers=workers) as bench:
    asked = [
        bench.build_experiment("sensor/distance/longer", scenario, start, value=value, hold_s=hold)
        for scenario in "AB"
        for start in (1.0, "near")
        for value in (5, 12.5, 40)
        for hold in (None, 0.5)
    ]
    results = bench.results()
    for begin in range(0, len(asked), size):
        bench.submit(asked[begin : begin + size], f"from {begin}")
        if begin:  # so two batches are in flight
            for _ in range(size):
                next(results)
"""


def ask(workspace: Workspace, out: Path, workers: int, size: int) -> subprocess.Popen[bytes]:
    words = [str(workspace.library.parent), str(out), str(workers), str(size)]
    return subprocess.Popen([sys.executable, "-c", _ASK, *words], start_new_session=True)


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
@pytest.mark.parametrize(("workers", "size"), [(1, 2), (2, 5)])
def test_kills_inside_and_between_batches_change_nothing(
    toycar: Workspace, tmp_path: Path, workers: int, size: int
) -> None:
    """Killed at random moments, resumed, with two batches in flight: the records, the seal and the digest of
    the plan of one batch that was left alone; and no experiment has a second record.
    """
    alone = ask(toycar, tmp_path / "alone", 1, 100)
    assert alone.wait(600) == 0
    out, rng = tmp_path / "killed", random.Random(size)
    for _ in range(_KILLS):
        process = ask(toycar, out, workers, size)
        try:
            assert process.wait(rng.uniform(1.0, 4.0)) == 0
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
    assert ask(toycar, out, workers, size).wait(600) == 0
    first, second = (mutator.load_run(tmp_path / name, workspace=toycar) for name in ("alone", "killed"))
    assert second.seal == first.seal is not None
    assert dict(load_records(out)) == dict(load_records(tmp_path / "alone"))
    assert second.verify().differences == ()


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
def test_a_cluster_gives_the_same_seal(toycar: Workspace, tmp_path: Path) -> None:
    """The workers of `local:2` do the work of two batches, in two openings and after a kill."""
    pytest.importorskip("distributed")
    script = tmp_path / "ask.py"  # Dask's workers import the script
    call = 'campaign="small", workers=workers'
    assert call in _ASK
    text = _ASK.replace(call, f'{call}, reuse=False, cluster="local:2"')
    head, _, rest = text.partition("library, out")
    body = "".join(f"    {line}\n" for line in f"library, out{rest}".splitlines())
    script.write_text(f"{head}if __name__ == '__main__':\n{body}")
    words = [sys.executable, str(script), str(toycar.library.parent), str(tmp_path / "cluster"), "1", "12"]
    with subprocess.Popen(words, start_new_session=True) as process:
        try:
            process.wait(6.0)
        except subprocess.TimeoutExpired:
            process.kill()
    assert subprocess.run(words, check=False).returncode == 0
    assert ask(toycar, tmp_path / "alone", 1, 100).wait(600) == 0
    first, second = (mutator.load_run(tmp_path / name, workspace=toycar) for name in ("alone", "cluster"))
    assert second.seal == first.seal is not None
    assert second.verify().differences == ()
    assert any("cluster" in path.name for path in (tmp_path / "cluster" / "records").iterdir())


_ASK_TWICE = """
import json, os, signal, sys, time
from pathlib import Path
import mutator

def processes(word):
    \"\"\"Return the ids of descendants with a word in their command.\"\"\"
    found, todo = [], [os.getpid()]
    while todo:
        for path in Path(f"/proc/{todo.pop()}/task").glob("*/children"):
            for pid in map(int, path.read_text().split()):
                todo.append(pid)
                if word in Path(f"/proc/{pid}/cmdline").read_text().split("\\0"):
                    found.append(pid)
    return sorted(found)

def golden_runs():
    cache = Path(os.environ["XDG_CACHE_HOME"]) / "mutator" / "goldens"
    return {path.name: path.stat().st_mtime_ns for path in sorted(cache.iterdir())}

def note(bench, *asked):
    records = bench.run([bench.build_experiment("sensor/distance/longer", *words, value=value)
        for *words, value in asked])
    assert [record.status for record in records] == ["ok"] * len(asked), records
    pieces = processes("mutator.execution.cluster.piece_process")
    workers = [pid for pid in processes("--multiprocessing-fork")]
    safe_path = os.environ.get("PYTHONSAFEPATH")
    told.append({"workers": workers, "pieces": pieces, "goldens": golden_runs(), "safe": safe_path})

if __name__ == "__main__":
    told, (library, out) = [], sys.argv[1:3]
    workspace = mutator.Workspace.find(root=library)
    with mutator.open_bench(workspace, out, campaign="small", reuse=False, cluster="local:2") as bench:
        first = [("A", 1.0 + 0.5 * number, 5 + number) for number in range(10)]
        note(bench, *first)
        note(bench, *[(scenario, start, value + 20) for scenario, start, value in first])
        note(bench, *[("B", start, value) for _, start, value in first])
        os.kill(told[-1]["workers"][0], signal.SIGKILL)
        deadline = time.monotonic() + 60
        while len(processes("--multiprocessing-fork")) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        note(bench, *[("B", start, value + 20) for _, start, value in first])
    left = processes("mutator.execution.cluster.piece_process") + processes("--multiprocessing-fork")
    print(json.dumps([told, left, os.environ.get("PYTHONSAFEPATH")]))
"""


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
def test_the_workers_of_a_cluster_stay_between_batches(toycar: Workspace, tmp_path: Path) -> None:
    """The second batch meets the same processes and drives no golden run again; the third drives that of its
    scenario alone; a worker that dies is replaced; the end leaves nothing, and nothing of it is in the
    environment.
    """
    pytest.importorskip("distributed")
    script = tmp_path / "ask.py"  # Dask's workers import the script
    script.write_text(_ASK_TWICE)
    words = [sys.executable, str(script), str(toycar.library.parent), str(tmp_path / "run")]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    answer = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    (first, second, third, fourth), left, safe_path = json.loads(answer.stdout.splitlines()[-1])
    assert len(first["workers"]) == 2 and second["workers"] == third["workers"] == first["workers"]
    assert {*first["pieces"]} <= {*second["pieces"]} <= {*third["pieces"]} and len(third["pieces"]) == 2
    assert len(first["goldens"]) == 1 and len(third["goldens"]) == 2
    assert second["goldens"] == first["goldens"] and first["goldens"].items() <= third["goldens"].items()
    assert len(fourth["workers"]) == 2 and first["workers"][0] not in fourth["workers"]
    assert len({*fourth["pieces"]} & {*third["pieces"]}) == 1 and len(fourth["pieces"]) <= 2
    assert fourth["goldens"] == third["goldens"]
    assert left == []
    assert [first["safe"], second["safe"], third["safe"], safe_path] == [None] * 4
    run = mutator.load_run(tmp_path / "run", workspace=toycar)
    assert run.seal is not None and len(run.records) == 40
    assert run.verify().differences == ()


@pytest.mark.slow
@pytest.mark.parametrize(("number", "folder", "batch_count"), [(0, "search", 8), (1, "slopes", 6)])
def test_the_code_of_the_page_runs_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, folder: str, batch_count: int
) -> None:
    """Each block of Python leaves a sealed run folder with a result of each experiment and its batches."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUTATOR_ROOT", str(_CLONE))
    blocks = re.findall(
        r"^```python\n(.*?)^```$", _PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert len(blocks) == 2
    exec(compile(blocks[number], str(_PAGE), "exec"), {})
    run = mutator.load_run(tmp_path / "runs" / folder, workspace=Workspace.find(root=_CLONE))
    assert run.seal and len(run.records) == run.folder.head.experiments
    assert len((run.folder.path / "plan" / "batches.jsonl").read_text().splitlines()) == batch_count
