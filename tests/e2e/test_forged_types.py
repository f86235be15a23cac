"""Other types of values in each field of the files that the seal leaves out end no command in a traceback."""

import gzip
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.report import report_builder
from mutator.store.recorded_approvals import write_approvals
from mutator.store.series_script import read_script, write_script
from mutator.workspace import Workspace
from tests.torture.readers import cli

VALUES = ("x\x1b[2J", [["a"]], {"a": {"b": 1}}, None, True, -1e308, 10**400)
VERBS = (
    ("report",),
    ("verify", "--report"),
    ("show", "--run"),
    ("export", "--format", "csv", "--table", "timings"),
)
JSON = ("checks.json", "reviewed.json", "results.json", "report/made_from.json")
Place = tuple[Any, ...]


@pytest.fixture(scope="module")
def genuine(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> tuple[Workspace, Path]:
    place = tmp_path_factory.mktemp("genuine")
    workspace, run = copy_toycar(place), place / "run"
    assert run_campaign(workspace, "small", run, engine="fork").exit_code == 0
    group = {"group": "0" * 12, "by": "Jane", "decision": "approved", "diff": "1" * 16, "remarks": []}
    write_approvals(run, {"schema": "reviewed/1", "target": "toycar", "groups": [group]})
    report_builder.write_report(run, workspace)
    return workspace, run


def nodes(value: Any, path: Place = ()) -> Iterator[Place]:
    """Yield the paths to the first values of each object and list, and to the objects and lists."""
    if path:
        yield path
    if isinstance(value, dict):
        for key in [key for key in value if key != "schema"][:12]:
            yield from nodes(value[key], (*path, key))
    elif isinstance(value, list) and value:
        yield from nodes(value[0], (*path, 0))


def put(content: Any, path: Place, value: Any) -> Any:
    if not path:
        return value
    copy = content.copy()
    copy[path[0]] = put(content[path[0]], path[1:], value)
    return copy


def index_of(run: Path) -> Any:
    return json.loads(gzip.decompress(read_script(run / "series" / "index.js")))


def places(run: Path) -> Iterator[tuple[str, Place]]:
    """Yield each value that the seal leaves out: its file and where it is in there."""
    head = json.loads((run / "run.json").read_text())
    yield from (("run.json", ("stretches", *path)) for path in nodes(head["stretches"]))
    yield from (("run.json", ("choices", key)) for key in ("shard", "series_mb"))
    for name in JSON:
        yield from ((name, path) for path in nodes(json.loads((run / name).read_text())))
    [file] = (run / "timings").glob("*.jsonl")
    for path in nodes(json.loads(file.read_text().splitlines()[-1])):
        yield f"timings/{file.name}", path
    yield from (("series/index.js", path) for path in nodes(index_of(run)))


def forge(run: Path, name: str, path: Place, value: Any) -> None:
    file = run / name
    if name == "series/index.js":
        write_script(file, gzip.compress(json.dumps(put(index_of(run), path, value)).encode()))
    elif name.startswith("timings/"):
        *lines, last = file.read_text().splitlines()
        file.write_text("\n".join([*lines, json.dumps(put(json.loads(last), path, value)), ""]))
    else:
        file.write_text(json.dumps(put(json.loads(file.read_text()), path, value)))


def ends(genuine: tuple[Workspace, Path], run: Path, reseal: Any, *forgery: Any) -> Iterator[str]:
    """Forge one value and yield the verbs that end in a traceback, or print what controls a terminal."""
    workspace, original = genuine
    shutil.rmtree(run, ignore_errors=True)
    shutil.copytree(original, run)
    forge(run, *forgery)
    reseal(run)
    for verb, *options in VERBS:
        folder = (*options, run) if verb == "show" else (run, *options)
        code, out, err = cli(
            "--library", workspace.library, "--templates", workspace.templates, verb, *folder
        )
        if code not in (0, 1, 2) or "Traceback" in err or "\x1b[2J" in out + err:
            yield f"{forgery}: {verb} ended with {code}: {(out + err)[-300:]}"


def forgeries(run: Path) -> Iterator[tuple[str, Place, Any]]:
    """Two other values for each place, in turn."""
    for number, (name, path) in enumerate(places(run)):
        for turn in range(2):
            yield name, path, VALUES[(2 * number + turn) % len(VALUES)]


@pytest.mark.slow
def test_other_types_end_in_no_traceback(
    genuine: tuple[Workspace, Path], tmp_path: Path, reseal: Callable[..., None]
) -> None:
    every = [*forgeries(genuine[1])]
    wrong = [said for forgery in every for said in ends(genuine, tmp_path / "run", reseal, *forgery)]
    assert len(every) > 100
    assert not wrong, "\n".join(wrong)
