"""More than 200 forgeries of a finished run with recomputed digests: one for each field of its files.

None passes `verify --expect`, `--expect-review` and `--report`, except in the parts that the seal leaves out
on purpose. The slow test prints what plain `verify` sees of each kind.
"""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator._common.hashing import canonical_json
from mutator.audit.run_digests_and_seal import Seals, seals_of
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.report import report_builder
from mutator.store import file_digests
from mutator.store.file_digests import FileDigest
from mutator.store.recorded_approvals import write_approvals
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.made_up_results import edit_results

SAMPLE = 10  # the ordinary suite tries every nth forgery
OUTSIDE = {"run.json: stretches", "run.json: choices.shard", "run.json: choices.series_mb"}
OUTSIDE |= {"checks.json: digest", "checks.json: run_cpu_s", "timings"}
_SKIPPED = {"schema"}  # another schema is refused


@dataclass(frozen=True)
class Forgery:
    kind: str
    name: str
    apply: Callable[[Path], None]


@pytest.fixture(scope="module")
def genuine(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> tuple[Workspace, Path, Seals]:
    place = tmp_path_factory.mktemp("genuine")
    workspace, run = copy_toycar(place), place / "run"
    assert run_campaign(workspace, "small", run, engine="fork").exit_code == 0
    group = {"group": "0" * 12, "by": "Jane", "decision": "approved", "diff": "1" * 16, "remarks": []}
    write_approvals(run, {"schema": "reviewed/1", "target": "toycar", "groups": [group]})
    report_builder.write_report(run, workspace)
    return workspace, run, seals_of(RunFolder.open(run))


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths to the values in JSON content: of long lists and objects, only the first parts."""
    if isinstance(value, dict) and value:
        for key in list(value)[:40] if not path else list(value)[:12]:
            if key not in _SKIPPED:
                yield from leaves(value[key], (*path, key))
    elif isinstance(value, list) and value:
        for place in range(min(len(value), 2)):
            yield from leaves(value[place], (*path, place))
    else:
        yield path


def other(value: Any, name: object = "") -> Any:
    """Return another value of the same type, for the key `name`."""
    match value:
        case bool():
            return not value
        case int() | float():
            return value + 1
        case str():
            return f"{value}x"
        case None:
            return 1 if name == "series_mb" else "1/1"  # a size or a shard
        case list():
            return ["x"]
        case _:
            return {"x": "x"}


def changed(content: Any, path: tuple[Any, ...]) -> Any:
    if not path:
        return other(content)
    copy, (name, *rest) = content.copy(), path
    copy[name] = changed(content[name], tuple(rest)) if rest else other(content[name], name)
    return copy


def in_file(name: str, path: tuple[Any, ...]) -> Callable[[Path], None]:
    def apply(run: Path) -> None:
        file = run / name
        file.write_text(json.dumps(changed(json.loads(file.read_text()), path)))

    return apply


def in_line(name: str, line: int, path: tuple[Any, ...]) -> Callable[[Path], None]:
    def apply(run: Path) -> None:
        lines = (run / name).read_text().splitlines()
        lines[line] = canonical_json(changed(json.loads(lines[line]), path))
        (run / name).write_text("\n".join([*lines, ""]))

    return apply


def written(name: str, edit: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    """Change a file, or make it; a new file gets a digest as if the run had written it."""

    def apply(run: Path) -> None:
        file = run / name
        is_new = not file.exists()
        file.write_bytes(edit(b"" if is_new else file.read_bytes()))
        if is_new and name.startswith("golden/"):
            ledger = file_digests.load_ledger(run)
            file_digests.save_ledger(
                run, replace(ledger, files={**ledger.files, name: FileDigest.of_bytes(file.read_bytes())})
            )

    return apply


def harmless(table: bytes) -> bytes:
    return table.replace(b"hazard,", b"sdc,")


def gone(name: str) -> Callable[[Path], None]:
    def apply(run: Path) -> None:
        ledger = file_digests.load_ledger(run)
        shutil.rmtree(run / name)
        files = {key: one for key, one in ledger.files.items() if not key.startswith(f"{name}/")}
        file_digests.save_ledger(run, replace(ledger, files=files))

    return apply


def kind_of(name: str, path: tuple[Any, ...]) -> str:
    head = ".".join(map(str, path[:2])) if path[0] == "choices" else str(path[0])
    if path[0] == "stretches" and path[2] in ("python", "packages"):
        head = f"versions ({path[2]})"
    return f"{name}: {head}"


def forgeries(run: Path) -> Iterator[Forgery]:
    for name in ("run.json", "checks.json", "reviewed.json"):
        content = json.loads((run / name).read_text())
        for path in leaves(content):
            yield Forgery(kind_of(name, path), f"{name} {path}", in_file(name, path))
        yield Forgery(
            f"{name}: a new key", name, written(name, lambda data: data.replace(b"{", b'{"x": 1,', 1))
        )
    for kind in ("records", "proof", "timings"):
        [file] = (run / kind).glob("*.jsonl")
        name = f"{kind}/{file.name}"
        lines = file.read_text().splitlines()
        for line in (1, len(lines) - 1):
            content = {key: one for key, one in json.loads(lines[line]).items() if key != "sum"}
            for path in leaves(content):
                yield Forgery(kind, f"{name}:{line} {path}", in_line(name, line, path))
    for name in ("plan/experiments.jsonl", "plan/faults.jsonl"):
        content = json.loads((run / name).read_text().splitlines()[0])
        for path in leaves(content):
            yield Forgery("plan", f"{name} {path}", in_line(name, 0, path))
    for name in ("plan/experiments.jsonl", "plan/faults.jsonl", "plan.csv", "campaign.yaml"):
        yield Forgery("plan", f"{name}, a space", written(name, lambda data: data + b" "))
    for file in sorted((run / "golden").rglob("*.*")):
        name = file.relative_to(run).as_posix()
        yield Forgery("golden", name, written(name, lambda data: data[:-1] + b"x"))
    yield Forgery("golden", "a file more", written("golden/A/more.txt", lambda data: b"more"))
    yield Forgery("proof", "no proof", gone("proof"))
    yield Forgery("table", "results.csv", written("results.csv", harmless))
    yield Forgery("table", "both tables", lambda run: edit_results(run, "hazard", "sdc"))
    for name in ("index.html", "REPORT.md", "more.html"):
        yield Forgery("report", name, written(f"report/{name}", lambda data: data + b"All is well."))


def forged(genuine: tuple[Workspace, Path, Seals], place: Path, forgery: Forgery, reseal: Any) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    run = Path(shutil.copytree(genuine[1], place))
    forgery.apply(run)
    reseal(run)
    return run


def passes(genuine: tuple[Workspace, Path, Seals], run: Path) -> bool:
    """Whether a run passes the audit with all expected digests and its pages."""
    workspace, _, seals = genuine
    try:
        found = seals_of(RunFolder.open_unverified(run))
    except (MutatorError, LookupError, ValueError, TypeError, AttributeError):
        return False
    if found != seals:
        return False
    audit = mutator.verify(run, expect=seals.seal, expect_review=seals.review_digest, workspace=workspace)
    if not audit.passed:
        return False
    return mutator.verify(run, report=True, workspace=workspace).passed


def has_results_digest(genuine: tuple[Workspace, Path, Seals], run: Path) -> bool:
    try:
        return seals_of(RunFolder.open_unverified(run)).results_digest == genuine[2].results_digest
    except (MutatorError, LookupError, ValueError, TypeError, AttributeError):
        return False


def is_outside(forgery: Forgery) -> bool:
    return forgery.kind in OUTSIDE


def test_the_genuine_run_passes(genuine: tuple[Workspace, Path, Seals]) -> None:
    assert passes(genuine, genuine[1])


def is_of_results(forgery: Forgery) -> bool:
    """Whether the results digest covers what is forged: what is recorded, and what it is judged by."""
    in_head = forgery.kind.startswith("run.json") and "versions" not in forgery.kind
    return forgery.kind in {"records", "golden"} or (in_head and forgery.kind != "run.json: provenance")


def test_no_forgery_of_a_result_or_its_judgement_has_the_results_digest(
    genuine: tuple[Workspace, Path, Seals], tmp_path: Path, reseal: Callable[..., None]
) -> None:
    of_results = [one for one in forgeries(genuine[1]) if is_of_results(one) and not is_outside(one)]
    for forgery in {one.kind: one for one in of_results}.values():
        run = forged(genuine, tmp_path / "run", forgery, reseal)
        assert not has_results_digest(genuine, run), forgery.name


def test_a_sample_of_forgeries_does_not_pass(
    genuine: tuple[Workspace, Path, Seals], tmp_path: Path, reseal: Callable[..., None]
) -> None:
    inside = [one for one in forgeries(genuine[1]) if not is_outside(one)]
    for forgery in inside[::SAMPLE]:
        run = forged(genuine, tmp_path / "run", forgery, reseal)
        assert not passes(genuine, run), forgery.name


@pytest.mark.slow
def test_no_forgery_passes_outside_the_list(
    genuine: tuple[Workspace, Path, Seals],
    tmp_path: Path,
    reseal: Callable[..., None],
    record_property: Callable[[str, object], None],
) -> None:
    """What is outside the seal passes, and the audit lists it as not sealed."""
    seen: Counter[tuple[str, str]] = Counter()
    every = [*forgeries(genuine[1])]
    wrong = []
    for forgery in every:
        run = forged(genuine, tmp_path / "run", forgery, reseal)
        caught = not passes(genuine, run)
        plain = plainly(genuine[0], run)
        seen[forgery.kind, "forged"] += 1
        seen[forgery.kind, "expected"] += caught
        seen[forgery.kind, "plain"] += plain
        if not caught and not is_outside(forgery):
            wrong.append(forgery.name)
        if is_of_results(forgery) and not is_outside(forgery) and has_results_digest(genuine, run):
            wrong.append(f"results digest: {forgery.name}")
        if is_outside(forgery):
            assert seals_of(RunFolder.open_unverified(run)) == genuine[2], forgery.name
            assert mutator.verify(run, workspace=genuine[0]).not_sealed["other files"]
    kinds = dict.fromkeys(forgery.kind for forgery in every)
    rows = [
        f"{kind:36} {seen[kind, 'forged']:6} {seen[kind, 'expected']:9} {seen[kind, 'plain']:6}"
        for kind in kinds
    ]
    head = f"{'changed, with all digests recomputed':36} forged  expected  plain"
    record_property("tally", "\n".join([head, *rows]))
    assert len(every) > 200 and wrong == []


def plainly(workspace: Workspace, run: Path) -> bool:
    """Whether plain `verify` sees a forgery."""
    try:
        return not mutator.verify(run, workspace=workspace).passed
    except MutatorError:
        return True
