"""Benches: lists of experiments, asked one after another."""

import json
import math
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mutator
from mutator import Bench, Experiment, MutatorError
from mutator.audit.run_audit import run_audit_checks
from mutator.campaigns.plan import build_plan
from mutator.execution import bench_crew
from mutator.model import AfterHazard
from mutator.workspace import Workspace

pytestmark = pytest.mark.usefixtures("kept_checks")


@contextmanager
def opened(toycar: Workspace, out: Path, **arguments: Any) -> Iterator[Bench]:
    with mutator.open_bench(toycar, out, campaign="small", **arguments) as bench:
        yield bench


def shifted(bench: Bench, *values: float, at_s: float = 1.0, scenario: str = "A") -> list[Experiment]:
    """Experiments with these values of the shifted lane."""
    return [bench.build_experiment("sensor/distance/longer", scenario, at_s, value=value) for value in values]


def differences(out: Path, toycar: Workspace) -> list[str]:
    """What an audit finds in a run folder."""
    folder = mutator.load_run(out).folder
    return [str(d) for check in run_audit_checks(folder, toycar) for d in check.differences]


def test_a_bench_gives_the_records_of_a_campaign(toycar: Workspace, tmp_path: Path) -> None:
    """The same experiments have the same ids and records, however they are asked for."""
    planned = build_plan(toycar, "small").experiments
    campaign = mutator.run("small", tmp_path / "c", workspace=toycar)
    with opened(toycar, tmp_path / "b", seed=3) as bench:
        records = bench.run(planned)
    assert [record.experiment_id for record in records] == [experiment.id for experiment in planned]
    assert {record.experiment_id: record for record in records} == dict(campaign.records)
    assert differences(tmp_path / "b", toycar) == []
    rows = mutator.load_run(tmp_path / "b", workspace=toycar).results.drop(columns="seed")
    assert len(rows) == len(planned)


def test_borders_of_batches_and_openings_change_neither_records_nor_seal(
    toycar: Workspace, tmp_path: Path
) -> None:
    """One batch, or several by two workers in two openings: only the digest of the batches differs."""
    with opened(toycar, tmp_path / "one") as bench:
        asked = [*shifted(bench, 5, 12.5), *shifted(bench, 40, scenario="B"), *shifted(bench, 5, at_s=2)]
        first = bench.run(asked, "all at once")
    with opened(toycar, tmp_path / "many", workers=2) as bench:
        second = [*bench.run(asked[:1]), *bench.run(asked[1:3])]
    with opened(toycar, tmp_path / "many") as bench:
        assert repr(bench) == "<Bench many: 3 experiments>"
        second += bench.run(asked[3:])
        proof = str(bench.prove())
    assert first == second
    assert "3 of 3 chosen among the first 3 or as the first of their fault type or scenario" in proof
    assert proof.endswith("how many other records an engine could have changed is not known")
    one, many = (mutator.load_run(tmp_path / name).seals for name in ("one", "many"))
    assert one.seal == many.seal is not None
    assert one.results_digest == many.results_digest
    assert one.batches_digest != many.batches_digest
    lines = (tmp_path / "many" / "plan" / "batches.jsonl").read_text().splitlines()
    assert [json.loads(line)["experiments"] for line in lines] == [1, 2, 1]
    audit = mutator.verify(tmp_path / "many", expect=many.batches_digest, workspace=toycar)
    assert audit.differences == () and "batches digest as expected" in str(audit)


def test_nothing_is_computed_twice(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An experiment that has a record is answered without a worker, also after the bench was closed."""
    with opened(toycar, tmp_path / "b") as bench:
        asked = shifted(bench, 5, 40)
        records = bench.run([*asked, asked[0]])
        assert records[2] == records[0]
    seal = mutator.load_run(tmp_path / "b").seal
    monkeypatch.setattr(bench_crew.BenchCrew, "_start_worker", lambda self: pytest.fail("a worker began"))
    with opened(toycar, tmp_path / "b") as bench:
        assert bench.run(asked[::-1], "again") == records[1::-1]
    assert mutator.load_run(tmp_path / "b").seal == seal
    assert len((tmp_path / "b" / "plan" / "batches.jsonl").read_text().splitlines()) == 1


def test_an_edited_source_is_refused_with_its_name(toycar: Workspace, tmp_path: Path) -> None:
    """What a bench answers follows from one state of target, library and templates."""
    with opened(toycar, tmp_path / "b") as bench:
        asked = shifted(bench, 5)
        record = bench.run(asked)
        for path in (
            toycar.library / "faults" / "sensor" / "lane.yaml",
            toycar.library / "scenarios" / "A.yaml",
            toycar.templates / "offset.yaml",
            toycar.library.parent / "tree" / "toycar" / "sensing.py",
        ):
            text = path.read_text()
            path.write_text(text + "# edited\n")
            with pytest.raises(MutatorError, match=rf"{path.name}.*changed while the bench was open"):
                bench.run(shifted(bench, 40) if path.parent.name != "scenarios" else asked)
            path.write_text(text)
        assert bench.run(asked) == record


def test_a_second_caller_is_refused(toycar: Workspace, tmp_path: Path) -> None:
    """One caller at a time uses a bench; the others get an error at once."""
    with opened(toycar, tmp_path / "b") as bench:
        errors: list[BaseException] = []

        def call() -> None:
            try:
                bench.run([])
            except MutatorError as err:
                errors.append(err)

        with bench._opened.calls.calling():
            thread = threading.Thread(target=call)
            thread.start()
            thread.join()
        assert "another call is running" in str(errors[0])
        assert bench.run([]) == []
    assert not (tmp_path / "b").exists()


def test_an_interruption_leaves_the_bench_usable(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After Ctrl-C in a batch, the next call gives all records, and repeats none."""
    receive, received = bench_crew._receive, []

    def interrupted(*arguments: Any) -> Any:
        received.append(receive(*arguments))
        if len(received) == 3:  # the worker is ready, and has two records
            os.kill(os.getpid(), signal.SIGINT)
        return received[-1]

    monkeypatch.setattr(bench_crew, "_receive", interrupted)
    with opened(toycar, tmp_path / "b") as bench:
        asked = shifted(bench, 5, 12.5, 40)
        with pytest.raises(KeyboardInterrupt):
            bench.run(asked)
        assert {experiment.id for experiment in bench.pending} <= {e.id for e in asked[1:]}
        assert [record.experiment_id for record in bench.run(asked)] == [e.id for e in asked]
    assert mutator.load_run(tmp_path / "b").seal
    assert differences(tmp_path / "b", toycar) == []


def test_a_worker_that_dies_is_replaced(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The call that loses a worker fails with its name; the next one begins another."""
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(shifted(bench, 5))
        [worker] = bench._opened._crew._workers
        monkeypatch.setattr(worker.process, "poll", lambda: None)  # it dies after this question
        os.kill(worker.process.pid, signal.SIGKILL)
        with pytest.raises(MutatorError, match=r"worker 0001-w0 died"):
            bench.run(shifted(bench, 40))
        assert len(bench.run(shifted(bench, 40))) == 1
    assert mutator.load_run(tmp_path / "b").seal
    assert differences(tmp_path / "b", toycar) == []


def test_a_failed_golden_run_leaves_no_plan(toycar: Workspace, tmp_path: Path) -> None:
    """A scenario that cannot be driven is refused, and what was asked before stays."""
    (toycar.library / "scenarios" / "broken.yaml").write_text("nothing: true\n")
    with opened(toycar, tmp_path / "b") as bench:
        asked = shifted(bench, 5)
        bench.run(asked)
        with pytest.raises(mutator.CheckFailed, match="golden broken@0"):
            bench.run(shifted(bench, 5, scenario="broken"))
        assert len(bench.run(asked)) == 1
    assert mutator.load_run(tmp_path / "b").folder.head.experiments == 1
    assert mutator.load_run(tmp_path / "b").seal


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"seed": 9}, "this bench was opened with other arguments"),
        ({"canary": None, "limits": {"steps": 150}}, "this bench was opened with other arguments"),
        ({"workers": 0}, "workers: 0; expected a positive number"),
        ({"after_hazard": "never"}, "after_hazard: 'never'; expected `go_on` or `stop`"),
        ({"limits": {"steps": np.int64(200)}}, "limits: .*int64.*expected plain numbers"),
        ({"limits": {"steps": math.nan}}, "limits: .*nan.*expected plain numbers"),
        ({"limits": {"stairs": 1}}, "^limits: unknown key 'stairs'"),
        ({"limits": {"steps": -1}}, "^limits: .*-1"),
        (
            {"canary": {"spec": "sensor/lane/none", "scenario": "A", "hazard": "H3", "at_s": 1}},
            "^canary: .*sensor/lane/none",
        ),
        ({"reading": "as_told"}, "as_told"),
    ],
)
def test_wrong_arguments_are_refused(
    toycar: Workspace, tmp_path: Path, change: dict[str, Any], expected: str
) -> None:
    """A mistake, or other arguments than the first time, end in an error that names them and in no folder."""
    if "other" in expected:
        with opened(toycar, tmp_path / "b") as bench:
            bench.run(shifted(bench, 5))
    with pytest.raises(MutatorError, match=expected), opened(toycar, tmp_path / "b", **change):
        pass
    assert (tmp_path / "b").exists() == ("other" in expected)


def test_an_experiment_must_fit_the_bench(toycar: Workspace, tmp_path: Path) -> None:
    """Another reading, another end of runs, an old scenario, or no experiment at all is refused."""
    with opened(toycar, tmp_path / "b") as bench:
        [good] = shifted(bench, 5)
        for asked, expected in (
            ("text", "a list of experiments"),
            (None, "a list of experiments"),
            ([_changed(good, method="guided")], "method 'guided'"),
            ([_changed(good, trigger="near")], "an experiment that the plan cannot store"),
            ([_changed(good, fault=_changed(good.fault, injections=("text",)))], "the plan cannot store"),
            (good, "a list of experiments"),
            ([good.fault], "experiments, as `build_experiment` makes them"),
            (
                [_changed(good, after_hazard=AfterHazard.STOP)],
                "after_hazard",
            ),
            ([_changed(good, scenario_digest="0" * 64)], "scenario_digest"),
            ([_changed(good, setting=("lonely",))], "change 'lonely'"),
            ([_changed(good, seed=-1)], "seed -1; expected seeds from 0"),
            ([_changed(good, fault=_changed(good.fault, reading="as_coded"))], "reading 'as_coded'"),
        ):
            with pytest.raises(MutatorError, match=expected):
                bench.run(asked)  # type: ignore[arg-type]


def test_experiments_can_come_from_a_generator(toycar: Workspace, tmp_path: Path) -> None:
    """A generator is read once, and each of its experiments has its record."""
    with opened(toycar, tmp_path / "b") as bench:
        assert len(bench.run(experiment for experiment in shifted(bench, 5, 40))) == 2


@pytest.mark.parametrize("reason", [None, 3, Path("x"), "\ud800"])
def test_a_reason_is_text(toycar: Workspace, tmp_path: Path, reason: Any) -> None:
    """Anything else is refused before the batch, and the bench can be used further."""
    with opened(toycar, tmp_path / "b") as bench:
        with pytest.raises(MutatorError, match=r"reason: .*; expected text"):
            bench.run(shifted(bench, 5), reason)
        assert bench.run([], "text") == []


def test_a_campaigns_folder_is_no_bench(toycar: Workspace, tmp_path: Path) -> None:
    """A bench never grows the plan of a campaign, and a campaign never continues a bench."""
    mutator.plan("small", out=tmp_path / "c", workspace=toycar)
    with pytest.raises(MutatorError, match="holds a run of campaign 'small'"), opened(toycar, tmp_path / "c"):
        pass
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(shifted(bench, 5))
    with pytest.raises(MutatorError, match="holds a run of campaign 'bench'"):
        mutator.run("small", tmp_path / "b", workspace=toycar)


def test_without_a_canary_the_results_begin_with_a_note(toycar: Workspace, tmp_path: Path) -> None:
    """Nobody should take a run without any hazard for a safe controller."""
    with (
        pytest.warns(mutator.MutatorWarning, match="no experiment reached a hazard"),
        mutator.open_bench(toycar, tmp_path / "b", limits={"steps": 200}) as bench,
    ):
        bench.run(shifted(bench, 5))
    assert "canary" in mutator.load_run(tmp_path / "b", workspace=toycar).no_canary_note()


def _changed(what: Any, **values: Any) -> Any:
    from dataclasses import replace

    return replace(what, **values)


@pytest.mark.usefixtures("without_figures")
def test_a_bench_has_just_the_seeds_that_were_asked_for(toycar: Workspace, tmp_path: Path) -> None:
    """Report, comparison and golden runs name these seeds; seeds are not compared as if they were repeats."""
    with opened(toycar, tmp_path / "b") as bench:
        for scenario, seed in (("A", 0), ("A", 2**63 - 1), ("B", 7)):
            bench.run([bench.build_experiment("sensor/lane/shifted", scenario, 1.0, seed=seed)])
    run = mutator.load_run(tmp_path / "b", workspace=toycar)
    text = run.report().markdown.read_text()
    assert f"| seeds | 0, 7, {2**63 - 1} |" in text
    assert "## Seeds" not in text and "repeats the campaign" not in text
    assert len(run.golden("B")) == len(run.golden("B", seed=7)) > 0
    with pytest.raises(MutatorError, match="no golden run A"):
        run.golden("A", seed=7)
    assert mutator.compare(run, run).not_compared == {}


def test_a_context_with_a_hold_keeps_its_phrase(toycar: Workspace, tmp_path: Path) -> None:
    """A situation is told in words, also if the fault holds for a time from when it begins."""
    table = toycar.library / "stpa" / "contexts" / "near_far.yaml"
    words = "about: far behind the lead"
    table.write_text(table.read_text().replace(words, f"{words}\n    phrase: the lead is far ahead"))
    with opened(toycar, tmp_path / "b") as bench:
        bench.run([bench.build_experiment("sensor/distance/longer", "A", "far", value=5, hold_s=1)])
    assert set(mutator.load_run(tmp_path / "b").folder.head.phrases.situations) == {"far"}
