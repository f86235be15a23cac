"""The report's description of how experiments ran, and of their equivalence check."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Experiment, Outcome, Record, Status
from mutator.preflight import equivalence_check
from mutator.report import engine_summary, report_builder, report_digests
from mutator.report.experiment_facts import timings_frame
from mutator.results.table_building import build_tables
from mutator.store.checksummed_lines import LineWriter
from mutator.store.plan_choices import Choices
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.timings import TIMINGS_SCHEMA
from mutator.workspace import Workspace

WAYS = (("fork", ""), ("golden", ""), ("reference", "its golden run has <two> threads"), (None, ""))


def record(experiment: Experiment) -> Record:
    return Record(
        experiment_id=experiment.id,
        status=Status.OK,
        outcome=Outcome.MASKED,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(),
        hazards=(),
        alerts=(),
        trace_digest="",
    )


Finish = Callable[..., Path]


@pytest.fixture
def finish(toycar: Workspace, tmp_path: Path) -> Finish:
    """Create a finished run of four experiments, three of which are the sample. The first `proven` records of
    the sample, after `change`, are in the proof. With None, there is no proof."""

    def made(
        proven: int | None,
        change: Callable[[Record], Record] = lambda r: r,
        ways: Sequence[tuple[str | None, str]] = WAYS,
    ) -> Path:
        run = tmp_path / "run"
        plan = build_plan(toycar, "small", Choices(**asdict(Choices(limit=4))))
        freeze_plan(plan, run, toycar)
        records = [record(experiment) for experiment in plan.experiments]
        write_records(run / "records/0001-main.jsonl", records)
        if proven is not None:
            sample = equivalence_check.sample_ids_in_folder(RunFolder.open_unverified(run))
            sampled = [change(r) for r in records if r.experiment_id in sample]
            write_records(run / "proof/0001-main.jsonl", sampled[:proven])
        pairs = zip(records, ways, strict=False)
        lines = [timing(r.experiment_id) | {"engine": engine, "why": why} for r, (engine, why) in pairs]
        write(run / "timings/0001-main.jsonl", TIMINGS_SCHEMA, lines)
        return run

    return made


def timing(name: str) -> dict[str, object]:
    return {"experiment_id": name, "cpu_s": 0.1, "wall_s": 0.1, "host": "here", "worker": "0001-main"}


def write_records(path: Path, records: list[Record]) -> None:
    write(path, RECORDS_SCHEMA, [asdict(record) for record in records])


def write(path: Path, schema: str, lines: list[dict[str, object]]) -> None:
    plan = json.loads((path.parents[1] / "run.json").read_text())["plan"]
    writer = LineWriter(path, {"schema": schema, "plan": plan})
    for line in lines:
        writer.append(line)
    writer.close()


def summary(run: Path) -> engine_summary.EngineSummary | None:
    folder = RunFolder.open(run)
    return engine_summary.summarize_engines(folder, folder.records(), timings_frame(folder))


def test_each_way_of_running_is_counted_with_its_reasons(finish: Finish) -> None:
    told = summary(finish(3))
    assert told is not None
    ways = dict(told.table.rows)
    assert list(ways.values()) == ["1"] * 4
    assert "a fork of the golden run, just before the fault is first active" in ways
    assert any("cannot be forked: its golden run has <two> threads" in way for way in ways)


def test_less_frequent_reasons_share_a_line(finish: Finish) -> None:
    run = finish(None)
    more = [timing(f"{i}") | {"engine": "reference", "why": f"crash {i:02}"} for i in range(30)]
    write(run / "timings/0002-main.jsonl", TIMINGS_SCHEMA, more)
    told = summary(run)
    assert told is not None
    assert len(told.table.rows) == 3 + engine_summary.MOST_LISTED_REASONS + 1
    assert sum(int(count) for _, count in told.table.rows) == 34


def test_the_newest_timing_of_an_experiment_is_used(finish: Finish) -> None:
    run = finish(3)
    again = timing(record_ids(run)[0]) | {"engine": "reference", "why": "it leaves threads behind"}
    write(run / "timings/0002-main.jsonl", TIMINGS_SCHEMA, [again])
    told = summary(run)
    assert told is not None
    assert sum(int(count) for _, count in told.table.rows) == 4
    assert not any("fork of the golden run" in way for way, _ in told.table.rows)


def sampled_ids(run: Path) -> list[str]:
    return equivalence_check.sample_ids_in_folder(RunFolder.open_unverified(run))


def record_ids(run: Path) -> list[str]:
    return [line.split(",")[0] for line in (run / "plan.csv").read_text().splitlines()[1:]]


@pytest.mark.parametrize(
    ("proven", "said", "state"),
    [
        (
            3,
            "compared byte for byte: 3 of 3 experiments came out the same on the reference engine. 1 of them "
            "had run on that engine before, which proves nothing.",
            "3 of 3 same",
        ),
        (
            2,
            "2 of 3 experiments came out the same on the reference engine; the others could not be judged: "
            "they have no result yet.",
            "not finished: 2 of 3 judged, none differs",
        ),
        (
            None,
            "no equivalence check is needed.",
            "none needed",
        ),
    ],
)
def test_complete_partial_and_missing_proofs_are_distinguished(
    finish: Finish, proven: int | None, said: str, state: str
) -> None:
    told = summary(finish(proven))
    assert told is not None
    assert said in told.equivalence_text
    assert told.equivalence_text.endswith(said)
    assert told.equivalence_in_brief == state
    assert not told.has_failed_equivalence


def test_only_what_was_forked_proves_the_engine(finish: Finish) -> None:
    """The statement of a small sample is about the forked experiments, drawn and not drawn."""
    told = summary(finish(3, ways=[("fork", "")] * 4))
    assert told is not None
    assert told.equivalence_text.endswith(
        "3 of 3 experiments came out the same on the reference engine. An engine that changes 50% of the "
        "records or more would have been noticed with a chance of 95%."
    )


def test_a_sample_that_ran_on_the_reference_engine_excludes_nothing(finish: Finish) -> None:
    """If only an experiment outside of the sample was forked, the proof says that it shows nothing."""
    run = finish(3, ways=[("reference", "")] * 4)
    (forked,) = set(record_ids(run)) - set(sampled_ids(run))
    write(run / "timings/0002-main.jsonl", TIMINGS_SCHEMA, [timing(forked) | {"engine": "fork", "why": ""}])
    told = summary(run)
    assert told is not None
    assert "3 of them had run on that engine before, which proves nothing" in told.equivalence_text
    assert "how many other records an engine could have changed is not known" in told.equivalence_text
    assert "no sample of sensor/" in told.equivalence_text


def test_a_failed_proof_is_reported_first(finish: Finish) -> None:
    run = finish(3, change=lambda r: replace(r, trace_digest="0" * 64))
    build_tables(run)
    written = report_builder.write_report(run, None)
    texts = [path.read_text() for path in (written.markdown, written.page)]
    assert all(text.index("The equivalence check failed") < text.index("Planned: ") for text in texts)
    origin = written.page.with_name("origin.html").read_text()
    for text in (texts[0], origin):
        assert f"FAILED: experiment {sampled_ids(run)[0]} differs on the reference engine" in text
        assert "How the experiments were run" in text
    assert "its golden run has &lt;two&gt; threads" in origin


def test_new_results_of_the_proof_make_a_report_out_of_date(finish: Finish) -> None:
    run = finish(3)
    build_tables(run)
    before = report_digests.inputs_digest(RunFolder.open(run), None)
    assert before == report_digests.inputs_digest(RunFolder.open(run), None)
    write(run / "proof/0002-main.jsonl", RECORDS_SCHEMA, [])
    assert before != report_digests.inputs_digest(RunFolder.open(run), None)


def test_a_changed_trace_digest_makes_a_report_out_of_date(
    finish: Finish, reseal: Callable[[Path], None]
) -> None:
    """The results do not contain the digests of traces."""
    run = finish(3)
    build_tables(run)
    results, before = (
        (run / "results.csv").read_bytes(),
        report_digests.inputs_digest(RunFolder.open(run), None),
    )
    path = run / "records/0001-main.jsonl"
    path.write_text(path.read_text().replace('"trace_digest":""', '"trace_digest":"0"'))
    reseal(run)
    build_tables(run)
    assert (run / "results.csv").read_bytes() == results
    assert before != report_digests.inputs_digest(RunFolder.open(run), None)


def test_a_failed_proof_is_reported_without_timings(finish: Finish) -> None:
    told = summary(finish(3, lambda r: replace(r, tree="x"), ways=()))
    assert told is not None
    assert told.has_failed_equivalence


def test_without_timings_and_proof_the_report_names_no_engine(finish: Finish) -> None:
    assert summary(finish(None, ways=())) is None
