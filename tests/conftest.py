"""Fixtures that several kinds of tests share."""

import ast
import dataclasses
import gc
import json
import shutil
import signal
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plan import Plan, build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import append_session_environment
from mutator.model import (
    Anchor,
    AnchorKind,
    Experiment,
    Fault,
    FaultLocation,
    Hold,
    Injection,
    Method,
    ObservedActivation,
    Outcome,
    Record,
    Status,
    Trigger,
)
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.report.panels import figures_panel
from mutator.store import file_digests
from mutator.store.checksummed_lines import LineWriter, read_segment
from mutator.store.file_digests import FileDigest
from mutator.store.packed_patches import PatchFolder, PatchWriter, rewrite_patch_file
from mutator.store.plan_choices import Choices
from mutator.store.records import RECORDS_SCHEMA, record_as_json
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import SessionEnvironment
from mutator.store.timings import TIMINGS_SCHEMA
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

from . import toy_eyes
from .garbage_collection import exempt_late_modules_from_collection, exempt_objects_from_collection
from .looked_up_once import looked_up_once
from .parsed_once import parsed_once

_TESTS = Path(__file__).parent

gc.disable()  # until all tests are collected

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell starts background commands with Ctrl-C ignored; the commands under test would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("torture")
    group.addoption("--tries", type=int, metavar="N", help="number of cases of each torture test")
    group.addoption("--seed", type=int, metavar="SEED", help="run each torture test only with this seed")


def pytest_collection_finish() -> None:
    """Collect the objects that come after now seldom."""
    exempt_objects_from_collection()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_runtest_logfinish() -> None:
    """After a test's fixtures are gone."""
    exempt_late_modules_from_collection()


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the tallies that tests recorded in any process."""
    reports = [*terminalreporter.getreports("passed"), *terminalreporter.getreports("failed")]
    told = [text for report in reports for name, text in report.user_properties if name == "tally"]
    for text in told:
        terminalreporter.write_line(f"\n{text}")


@pytest.fixture(scope="session", autouse=True)
def _caches(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep the caches of module and session fixtures apart from the user's. All tests share matplotlib's font
    cache and the bytecode, which are slow to rebuild. These fixtures have no store of finished runs, so that
    each of them really runs its experiments."""
    folder = tmp_path_factory.mktemp("caches")
    (folder / "mutator").mkdir()
    (folder / "mutator" / "finished").touch()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPLCONFIGDIR", str(folder / "matplotlib"))
        patch.setenv("XDG_CACHE_HOME", str(folder))
        patch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
        patch.setenv("COLUMNS", "1000")  # keep the sentences that tests look for on one line
        yield folder


@pytest.fixture(scope="session", autouse=True)
def _work_is_done_once() -> Iterator[None]:
    with parsed_once(), looked_up_once():
        yield


@pytest.fixture(autouse=True)
def _cache(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, _caches: Path
) -> Iterator[Path]:
    """Give each test an empty cache, and delete the cache after the test, because frames take 184 MB."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def kept_checks(_cache: Path, _caches: Path) -> None:
    """Reuse the results of checks that passed in an earlier test of the same sources: checks are slow."""
    kept = _caches / "mutator" / "checks"
    kept.mkdir(parents=True, exist_ok=True)
    (_cache / "mutator").mkdir()
    (_cache / "mutator" / "checks").symlink_to(kept)


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no figures in reports. They take seconds, and other tests look at them."""
    monkeypatch.setattr(figures_panel, "draw_figures", lambda frame: ())


@pytest.fixture
def toy(toycar: Workspace) -> Workspace:
    """The toy target, for all tests except the unit tests of specs and mutants."""
    return toycar


@pytest.fixture
def toycar(tmp_path: Path, copy_toycar: Callable[[Path], Workspace]) -> Workspace:
    """A copy of the toy car's library and tree, with the project's templates and the hostile ones."""
    return copy_toycar(tmp_path)


@pytest.fixture(scope="session")
def copy_toycar() -> Callable[[Path], Workspace]:
    """Write a copy of the toy car, whose files are read only once, because hundreds of tests make one."""
    sources = ((_TESTS / "toy", "."), (_TESTS.parent / "templates", "templates"))
    files = {Path(at, name): data for source, at in sources for name, data in _files(source).items()}
    folders = sorted({file.parent for file in files})

    def copy(folder: Path) -> Workspace:
        root = folder / "toy"
        for name in folders:
            (root / name).mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            (root / name).write_bytes(data)
        return Workspace(library=root / "fault_library", templates=root / "templates")

    return copy


def _files(folder: Path) -> dict[Path, bytes]:
    paths = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder): path.read_bytes() for path in paths}


@pytest.fixture(scope="session")
def give_eyes() -> Callable[..., None]:
    """Give the car of a copied toy a camera frame, and add the image effect `sensor/light` to its library."""
    return toy_eyes.give_eyes


@pytest.fixture
def pole(tmp_path: Path) -> Workspace:
    """A copy of the pole target's library and tree, with the project's templates."""
    root = tmp_path / "pole"
    shutil.copytree(_TESTS / "pole", root, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(_TESTS.parent / "templates", root / "templates")
    return Workspace(library=root / "fault_library", templates=root / "templates")


@pytest.fixture
def experiment() -> Callable[..., Experiment]:
    """Build an experiment with the given fields. The other fields have defaults."""

    def make(
        value: float = 1.0,
        scenario: str = "S1",
        method: Method = Method.GUIDED,
        trigger: str = "C1",
        spec: str = "radar/chaff/distance",
        changes: tuple[str, ...] = (),
    ) -> Experiment:
        module, fault_type, _ = spec.split("/")
        place = FaultLocation(
            path="pkg/radar.py", function="measure", anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="d_rel")
        )
        params = (("by", value), ("target", "d_rel"))
        fault = Fault(
            spec=spec,
            module=module,
            fault_type=fault_type,
            reading="as_described",
            value=value,
            unit="m",
            aim="H1",
            injections=(Injection(location=place, model="offset", params=params),),
            changes=changes,
        )
        condition = "t >= 2.0" if method is Method.RANDOM else "hwt <= 2.0"
        return Experiment(
            fault=fault,
            scenario=scenario,
            scenario_digest="d" * 64,
            method=method,
            trigger=Trigger(name=trigger, condition=condition, hold=Hold.WHILE, armed_after_s=1.5),
            seed=7,
        )

    return make


@pytest.fixture(scope="session")
def record() -> Callable[..., Record]:
    """Build the record of a masked fault. The given fields replace the defaults."""

    def make(experiment_id: str = "e" * 16, **given: Any) -> Record:
        fields: dict[str, Any] = {
            "experiment_id": experiment_id,
            "status": Status.OK,
            "outcome": Outcome.MASKED,
            "detail": "",
            "tree": "t" * 64,
            "activation": ObservedActivation(first=2.0, last=3.0, count=5),
            "t_manifest": None,
            "max_dev": (("gas", 0.0), ("brake", 0.0), ("steer_torque", 0.0)),
            "hazards": (),
            "alerts": (),
            "trace_digest": "f" * 64,
        }
        return Record(**fields | given)

    return make


@pytest.fixture(scope="session")
def put_patches() -> Callable[[Path, Mapping[str, bytes | None]], None]:
    """Replace or remove the patches of experiments in a run folder."""

    def put(run: Path, given: Mapping[str, bytes | None]) -> None:
        found = PatchFolder(run)
        [path] = found.block_files()
        patches = {name: found.read_patch(name) for name in found} | given
        rewrite_patch_file(path, [(name, data) for name, data in patches.items() if data is not None])

    return put


@pytest.fixture(scope="session")
def write_run(record: Callable[..., Record]) -> Callable[..., Path]:
    """Create a run folder with synthetic records without running anything."""

    def write(
        workspace: Workspace,
        out: Path,
        became: Callable[[Experiment], dict[str, Any] | None] = lambda experiment: {},
        campaign: str = "toy",
        changed: Callable[[Plan], Plan] = lambda plan: plan,
        **choices: Any,
    ) -> Path:
        """`became` returns the fields of an experiment's record, or None if the experiment has no record.
        `changed` alters the campaign's plan."""
        plan = changed(build_plan(workspace, campaign, Choices(**choices)))
        freeze_plan(plan, out, workspace)
        compared = workspace.manifest(plan.campaign.target).compared_channels
        unchanged = {"max_dev": tuple((channel.name, 0.0) for channel in compared)}
        lines = LineWriter(out / "records" / "0001-a.jsonl", {"schema": RECORDS_SCHEMA, "plan": plan.digest})
        for experiment in plan.experiments:
            fields = became(experiment)
            if fields is not None:
                lines.append(record_as_json(record(experiment.id, **unchanged | fields)))
        lines.close()
        return out

    return write


@pytest.fixture(scope="session")
def of_operators() -> Callable[[Workspace, str], Callable[[Plan], Plan]]:
    """Replace a plan's experiments by mutants, each of which changes the sign of one arithmetic operation.
    Each mutant runs like the plan's first experiments, but is permanent in the second."""

    def of(workspace: Workspace, path: str, drives: int = 2) -> Callable[[Plan], Plan]:
        def changed(plan: Plan) -> Plan:
            tree = workspace.manifest(plan.campaign.target).tree
            faults = list(operator_faults(parsed_file(tree, path)))
            some = [
                dataclasses.replace(
                    drive, fault=fault, **({"trigger": always_trigger()} if number == 1 else {})
                )
                for fault in faults
                for number, drive in enumerate(plan.experiments[:drives])
            ]
            return dataclasses.replace(plan, experiments=some, chunks=(len(some),), runs=len(some))

        return changed

    return of


def operator_faults(file: ParsedFile) -> Iterator[Fault]:
    for function, known in file.expressions_by_function.items():
        seen: list[str] = []
        for expression in known:
            seen.append(expression.anchor_name)
            if not isinstance(expression.node, ast.BinOp):
                continue
            anchor = Anchor(
                kind=AnchorKind.VALUE, name=expression.anchor_name, nth=seen.count(expression.anchor_name)
            )
            place = FaultLocation(path=file.path, function=function, anchor=anchor)
            yield Fault(
                spec=f"operators/arithmetic/{file.path}::{function}",
                module="operators",
                fault_type="arithmetic",
                reading="as_described",
                value=f"{expression.anchor_name} -> -({expression.anchor_name})",
                unit="-",
                aim="H3",
                injections=(Injection(location=place, model="scale", params=(("factor", -1),)),),
            )


@pytest.fixture(scope="session")
def write_finished(write_run: Callable[..., Path]) -> Callable[..., Path]:
    """Create a finished run folder with synthetic records, patches, checks, golden runs and proof."""

    def write(workspace: Workspace, out: Path, **given: Any) -> Path:
        patch = b"diff --git a/a.py b/a.py\n"
        write_run(workspace, out, lambda experiment: {"patch": file_digests.digest(patch)}, **given)
        folder = RunFolder.open_unverified(out)
        lines = [
            line
            for _, line in read_segment(out / "records" / "0001-a.jsonl").numbered_objects(RECORDS_SCHEMA)
        ]
        patches = PatchWriter(out, "0001-a")
        for line in lines:
            patches.append(line["experiment_id"], patch)
        patches.close()
        for kind, schema, some in (("proof", RECORDS_SCHEMA, lines[:3]), ("timings", TIMINGS_SCHEMA, lines)):
            writer = LineWriter(out / kind / "0001-a.jsonl", {"schema": schema, "plan": folder.head.plan})
            for line in some:
                cost = {"experiment_id": line["experiment_id"], "cpu_s": 1.0, "wall_s": 2.0, "host": "h"}
                writer.append(
                    line if kind == "proof" else cost | {"worker": "a", "engine": "reference", "why": ""}
                )
            writer.close()
        new = {"checks.json": b'{"schema": "checks/1", "results": [], "goldens": {}}'}
        for scenario, changes in folder.head.goldens:
            place = folder.golden_folder(scenario, tuple(changes)).relative_to(folder.path)
            new |= {f"{place}/{name}": name.encode() for name in folder.head.golden_files}
        with file_digests.announcing_rewrites(
            out, {name: FileDigest.of_bytes(data) for name, data in new.items()}
        ):
            for name, data in new.items():
                (out / name).parent.mkdir(parents=True, exist_ok=True)
                (out / name).write_bytes(data)
        append_session_environment(
            folder, SessionEnvironment(python="CPython 3.11.7", packages={"numpy": "2.4.6"}, platform="Linux")
        )
        file_digests.add_segments_to_ledger(out, finished=True)
        return out

    return write


@pytest.fixture(scope="session")
def reseal() -> Callable[..., None]:
    """Recompute every checksum and digest of a run folder, as a careful forger would."""

    def compute(run: Path, finished: bool | None = None) -> None:
        for path in (file for kind in ("records", "timings", "proof") for file in (run / kind).glob("*")):
            lines = [json.loads(line) for line in path.read_bytes().splitlines()]
            head, *content = [{k: v for k, v in line.items() if k != "sum"} for line in lines]
            path.unlink()
            writer = LineWriter(path, head)
            for line in content:
                writer.append(line)
            writer.close()
        known = file_digests.load_ledger(run)
        names = [name for name, one in known.files.items() if one.lines is None and (run / name).exists()]
        files = {name: FileDigest.of_bytes((run / name).read_bytes()) for name in names}
        file_digests.save_ledger(run, dataclasses.replace(known, files=files))
        file_digests.add_segments_to_ledger(run, finished=finished)

    return compute
