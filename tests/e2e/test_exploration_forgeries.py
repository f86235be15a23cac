"""Forgeries of an exploration whose digests were all redone: its proposals no longer follow from the records,
or its envelopes do not.
"""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pytest

import mutator
from mutator._common.hashing import digest
from mutator.audit.run_audit import AuditCheck
from mutator.campaigns.bench_files import EXPERIMENTS_PER_CHUNK
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_freezing import PLAN_CSV, plan_csv_bytes
from mutator.campaigns.plan_growth import BatchChain
from mutator.campaigns.plan_tally import plan_digest
from mutator.explore.envelope_files import ENVELOPES_FILE
from mutator.explore.exploration_replay import replay_exploration
from mutator.model import AfterHazard, Experiment
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD
from mutator.workspace import Workspace

Reseal = Callable[..., None]
CHECK = "proposals that follow from the records"


def explore(workspace: Workspace, out: Path) -> None:
    mutator.envelope(
        "sensor/lane/shifted",
        "A",
        1.0,
        out,
        points=9,
        longest_s=4.0,
        observe_s=0.5,
        validation=6,
        campaign="small",
        workspace=workspace,
    )


@pytest.fixture(scope="module")
def genuine(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> tuple[Workspace, Path]:
    place = tmp_path_factory.mktemp("explored")
    workspace = copy_toycar(place)
    explore(workspace, place / "run")
    return workspace, place / "run"


@pytest.fixture
def run(genuine: tuple[Workspace, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(genuine[1], tmp_path / "run"))


def check_of(run: Path, workspace: Workspace) -> AuditCheck:
    audit = mutator.verify(run, workspace=workspace)
    return next(check for check in audit.checks if check.checked_parts == CHECK)


def batches_of(run: Path) -> list[list[Experiment]]:
    experiments = iter(plan_file.load_experiments(run))
    lines = (json.loads(line) for line in (run / plan_file.BATCHES_FILE).read_text().splitlines())
    return [[next(experiments) for _ in range(line["experiments"])] for line in lines]


def reasons_of(run: Path) -> list[str]:
    lines = (run / plan_file.BATCHES_FILE).read_text().splitlines()
    return [json.loads(line)["reason"] for line in lines]


def write_batches(run: Path, batches: list[list[Experiment]], reasons: list[str] | None = None) -> None:
    """Write the plan anew, with all that follows from it."""
    chain, reasons = BatchChain(), reasons or [f"exploration, batch {n + 1}" for n in range(len(batches))]
    lines = [chain.line_of_next(len(batch), reason) for batch, reason in zip(batches, reasons, strict=True)]
    (run / plan_file.BATCHES_FILE).write_bytes(b"".join(lines))
    plan = load_plan(RunFolder.open_unverified(run))
    experiments = tuple(experiment for batch in batches for experiment in batch)
    count = len(experiments)
    sizes = [min(EXPERIMENTS_PER_CHUNK, count - n) for n in range(0, count, EXPERIMENTS_PER_CHUNK)]
    chunks = plan_file.write_plan(run, experiments, sizes)
    canary = plan.canary.id if plan.canary else ""
    edit_head(
        run,
        chunks=chunks,
        experiments=count,
        plan=plan_digest([e.id for e in experiments], (), canary, plan.campaign),
    )
    (run / PLAN_CSV).write_bytes(plan_csv_bytes(replace(plan, experiments=experiments)))


def edit_head(run: Path, **values: Any) -> None:
    head = json.loads((run / HEAD).read_text())
    (run / HEAD).write_text(json.dumps(head | values))


def edit_campaign(run: Path, pattern: str, replacement: str) -> None:
    text = (run / CAMPAIGN_FILE).read_text()
    edited = re.sub(pattern, replacement, text, count=1)
    assert edited != text
    (run / CAMPAIGN_FILE).write_text(edited)
    edit_head(run, campaign_digest=digest(edited.encode()))


def edit_record(run: Path, is_chosen: Callable[[dict[str, Any]], bool], **values: Any) -> None:
    for path in sorted((run / "records").iterdir()):
        lines = path.read_text().splitlines()
        for number, line in enumerate(lines[1:], 1):
            record = json.loads(line)
            if is_chosen(record):
                lines[number] = json.dumps(record | values)
                path.write_text("".join(f"{line}\n" for line in lines))
                return
    raise AssertionError("no such record")


def edit_envelopes(run: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    content = json.loads((run / ENVELOPES_FILE).read_text())
    before = json.dumps(content)
    edit(content["planes"][0])
    assert json.dumps(content) != before
    (run / ENVELOPES_FILE).write_text(json.dumps(content))


def replace_in_batch(run: Path, batch: int, number: int, forged: Callable[[Experiment], Experiment]) -> None:
    batches = batches_of(run)
    batches[batch][number] = forged(batches[batch][number])
    write_batches(run, batches)


# What a forger edits. The digests are redone afterwards.


def a_moved_border(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, second[:-1], [second[-1], *others[0]], *others[1:]])


def a_merged_batch(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [[*first, *second], *others])


def a_split_batch(run: Path) -> None:
    first, *others = batches_of(run)
    write_batches(run, [first[:1], first[1:], *others])


def a_reason(run: Path) -> None:
    reasons = reasons_of(run)
    write_batches(run, batches_of(run), [*reasons[:-1], "exploration, by hand"])


def swapped_batches(run: Path) -> None:
    first, second, third, *others = batches_of(run)
    write_batches(run, [first, third, second, *others])


def swapped_experiments(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, [second[1], second[0], *second[2:]], *others])


def a_dropped_experiment(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, second[1:], *others])


def a_dropped_batch(run: Path) -> None:
    first, _, *others = batches_of(run)
    write_batches(run, [first, *others])


def an_added_batch(run: Path) -> None:
    batches = batches_of(run)
    last = batches[-1][-1]
    trigger = replace(last.trigger, hold_s=0.15)
    write_batches(run, [*batches, [replace(last, trigger=trigger)]])
    for kind in ("records", "proof"):  # with the record of another one
        for path in sorted((run / kind).iterdir()):
            lines = path.read_text().splitlines()
            lines += [
                line.replace(last.id, replace(last, trigger=trigger).id) for line in lines if last.id in line
            ]
            path.write_text("".join(f"{line}\n" for line in lines))


def another_duration(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, hold_s=0.15)))


def another_value(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, fault=replace(e.fault, value=1.01)))


def another_start(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, condition="t >= 1.05")))


def another_hold(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, armed_after_s=0.5)))


def another_seed(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, seed=e.seed + 1))


def another_draw_of_the_validation(run: Path) -> None:
    batches = batches_of(run)
    drawn = max(n for n, batch in enumerate(batches) if "~" not in batch[0].fault.spec)
    planned = {e.trigger.hold_s for batch in batches for e in batch}
    hold_s = next(s for s in sorted(filter(None, planned)) if s != batches[drawn][0].trigger.hold_s)
    replace_in_batch(run, drawn, 0, lambda e: replace(e, trigger=replace(e.trigger, hold_s=hold_s)))


def the_seed_of_the_draw(run: Path) -> None:
    edit_campaign(run, r"\nseed: 0\n", "\nseed: 1\n")
    edit_head(run, seed=1)


def the_size_of_the_draw(run: Path) -> None:
    edit_campaign(run, '"validation": 6', '"validation": 5')


def the_window(run: Path) -> None:
    edit_campaign(run, '"observe_s": 0.5', '"observe_s": 3.0')


def a_magnitude(run: Path) -> None:
    edit_campaign(run, r'"magnitudes": \[[0-9.]+,', '"magnitudes": [0.001,')


def the_budget_of_the_search(run: Path) -> None:
    edit_campaign(run, '"search": 120', '"search": 4')


def the_size_of_batches(run: Path) -> None:
    edit_campaign(run, '"batch": 16', '"batch": 15')


def a_hazard_made_harmless(run: Path) -> None:
    first = {e.id for e in batches_of(run)[0]}
    edit_record(
        run,
        lambda record: record["outcome"] == "hazard" and record["experiment_id"] in first,
        outcome="sdc",
        hazards=[],
    )


def a_harmless_run_made_hazardous(run: Path) -> None:
    first = {e.id for e in batches_of(run)[0]}
    edit_record(
        run,
        lambda record: record["outcome"] != "hazard" and record["experiment_id"] in first,
        outcome="hazard",
        hazards=[["H3", 1.2]],
    )


def a_cell(run: Path) -> None:
    def edit(plane: dict[str, Any]) -> None:
        plane["cells"][-1] = plane["cells"][-1].replace("H", "o", 1)

    edit_envelopes(run, edit)


def a_curve(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["longest_survived_s"].__setitem__(-1, 4.0))


def a_validation(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["validations"][0].update(frame=1000))


def a_drawn_cell(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["validations"][0]["drawn"].pop())


def a_boundary_pair(run: Path) -> None:
    def edit(plane: dict[str, Any]) -> None:
        pair = next(pair for pair in plane["pairs"] if pair)
        pair["hazardous"] = pair["without_hazard"]

    edit_envelopes(run, edit)


def challenger_of(run: Path) -> tuple[int, int]:
    """Return batch and number of the first challenger."""
    return next(
        (n, i)
        for n, batch in enumerate(batches_of(run))
        for i, experiment in enumerate(batch)
        if "~" in experiment.fault.spec
    )


def a_challenger_made_hazardous(run: Path) -> None:
    names = {e.id for batch in batches_of(run) for e in batch if "~" in e.fault.spec}
    edit_record(
        run,
        lambda record: record["outcome"] == "sdc" and record["experiment_id"] in names,
        outcome="hazard",
        hazards=[["H3", 1.2]],
    )


def another_challenger(run: Path) -> None:
    replace_in_batch(
        run,
        *challenger_of(run),
        lambda e: replace(e, fault=replace(e.fault, spec="sensor/lane/shifted~ramp_2")),
    )


def a_challenger_of_another_shape(run: Path) -> None:
    def forged(experiment: Experiment) -> Experiment:
        [injection] = experiment.fault.injections
        params = tuple(sorted({**dict(injection.params), "period": 100.0}.items()))
        fault = replace(experiment.fault, injections=(replace(injection, params=params),))
        return replace(experiment, fault=fault)

    replace_in_batch(run, *challenger_of(run), forged)


def a_ramp_that_hardly_grows(run: Path) -> None:
    def forged(experiment: Experiment) -> Experiment:
        [injection] = experiment.fault.injections
        params = tuple(sorted({**dict(injection.params), "period": 1e6}.items()))
        fault = replace(experiment.fault, injections=(replace(injection, params=params),))
        return replace(experiment, fault=fault)

    batches = batches_of(run)
    ramps = [
        (n, i)
        for n, batch in enumerate(batches)
        for i, e in enumerate(batch)
        if e.fault.spec.endswith("~ramp")
    ]
    replace_in_batch(run, *ramps[0], forged)


def a_dropped_challenger(run: Path) -> None:
    batches = batches_of(run)
    batch, number = challenger_of(run)
    batches[batch] = [e for i, e in enumerate(batches[batch]) if i != number]
    write_batches(run, batches)


def the_challengers(run: Path) -> None:
    edit_campaign(run, r'"challengers": \["[a-z0-9_.]+", ', '"challengers": [')


def a_challenged_bound(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["challenges"][0].update(survived=[0, 0]))


def the_exploration(run: Path) -> None:
    edit_campaign(run, r"\nexplore: .*\n", "\n")


def the_end_of_a_run(run: Path) -> None:
    other = {AfterHazard.GO_ON: AfterHazard.STOP, AfterHazard.STOP: AfterHazard.GO_ON}
    replace_in_batch(run, 1, 0, lambda e: replace(e, after_hazard=other[e.after_hazard]))


FORGERIES = (
    the_exploration,
    the_end_of_a_run,
    a_moved_border,
    a_merged_batch,
    a_split_batch,
    a_reason,
    swapped_batches,
    swapped_experiments,
    a_dropped_experiment,
    a_dropped_batch,
    an_added_batch,
    another_duration,
    another_value,
    another_start,
    another_hold,
    another_seed,
    another_draw_of_the_validation,
    the_seed_of_the_draw,
    the_size_of_the_draw,
    the_window,
    a_magnitude,
    the_budget_of_the_search,
    the_size_of_batches,
    a_hazard_made_harmless,
    a_harmless_run_made_hazardous,
    a_cell,
    a_curve,
    a_validation,
    a_drawn_cell,
    a_boundary_pair,
    a_challenger_made_hazardous,
    another_challenger,
    a_challenger_of_another_shape,
    a_ramp_that_hardly_grows,
    a_dropped_challenger,
    the_challengers,
    a_challenged_bound,
)


def test_the_genuine_exploration_is_complete(genuine: tuple[Workspace, Path]) -> None:
    """It follows from its records, has hazards, and its envelopes are those of its file."""
    workspace, run = genuine
    assert check_of(run, workspace).differences == ()
    folder = RunFolder.open(run)
    replay = replay_exploration(folder, workspace.manifest("toycar"))
    assert (replay.differences, replay.unfinished_count) == ((), 0)
    [envelope] = mutator.load_run(run, workspace=workspace).envelopes
    assert json.loads((run / ENVELOPES_FILE).read_text())["planes"] == [envelope.as_json()]
    assert {"H", "o"} <= set("".join(envelope.as_json()["cells"])) and envelope.validation


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_a_forgery_with_redone_digests_is_found(
    genuine: tuple[Workspace, Path], run: Path, reseal: Reseal, forge: Callable[[Path], None]
) -> None:
    """The check names what does not follow; it does not merely stumble over it."""
    forge(run)
    reseal(run)
    [difference, *_] = check_of(run, genuine[0]).differences
    texts = r"follow|'exploration, batch|no further batch|no exploration"
    assert re.search(texts, str(difference)), difference


def test_an_exploration_that_was_cut_off_is_a_prefix(
    genuine: tuple[Workspace, Path], run: Path, reseal: Reseal
) -> None:
    """Fewer batches, or a batch without all its records, are no difference: it is said that a plane is
    unfinished, and its envelope has what was driven.
    """
    workspace, manifest = genuine[0], genuine[0].manifest("toycar")
    batches = batches_of(run)
    write_batches(run, batches[:2])
    keep_records(run, [experiment.id for batch in batches[:2] for experiment in batch])
    reseal(run)
    cut = replay_exploration(RunFolder(run), manifest)
    assert cut.differences == () and cut.envelopes[0].run_count == sum(map(len, batches[:2]))
    assert cut.note == "unfinished: 1 plane is not searched to the end"
    keep_records(run, [experiment.id for experiment in batches[0]])
    reseal(run, finished=False)
    killed = replay_exploration(RunFolder(run), manifest)
    assert killed.differences == () and killed.envelopes[0].run_count == len(batches[0])
    assert check_of(run, workspace).differences == ()


def keep_records(run: Path, names: list[str]) -> None:
    for path in (run / "records").iterdir():
        head, *lines = path.read_text().splitlines()
        kept = [line for line in lines if json.loads(line)["experiment_id"] in names]
        path.write_text("".join(f"{line}\n" for line in (head, *kept)))


@pytest.mark.parametrize("strategy", ["planes", "random"])
def test_a_search_is_replayed(
    genuine: tuple[Workspace, Path], tmp_path: Path, reseal: Reseal, strategy: Literal["planes", "random"]
) -> None:
    """Its proposals follow from its records, but not a moved border; the page begins with the findings."""
    workspace, run = genuine[0], tmp_path / "run"
    found = mutator.search(
        ["sensor/lane/shifted", "sensor/distance/longer"],
        "A",
        [0.5, 1.0],
        run,
        budget=24,
        strategy=strategy,
        longest_s=3.0,
        campaign="small",
        workspace=workspace,
    )
    assert check_of(run, workspace).differences == ()
    report = mutator.load_run(run, workspace=workspace).report()
    text = report.markdown.read_text()
    assert f"The search has {len(found)} finding" in text and "no share of them" in text
    page = report.page.read_text()
    assert all(f'href="#e={finding.result.experiment_id}"' in page for finding in found)
    assert (f'aria-label="{len(found)} findings after ' in page) is bool(found)
    first, second, *others = batches_of(run)
    write_batches(run, [first[:-1], [first[-1], *second], *others])
    reseal(run)
    assert check_of(run, workspace).differences


def test_a_worse_controller_has_a_smaller_envelope(
    genuine: tuple[Workspace, Path], tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    """One that steers harder leaves its lane at smaller errors: the gate names the plane and a run, and not
    in the other direction. A run compared with itself passes.
    """
    worse = copy_toycar(tmp_path)
    driver = worse.library.parent / "tree" / "toycar" / "driver.py"
    text = driver.read_text()
    driver.write_text(text.replace("-0.6 *", "-1.5 *"))
    assert driver.read_text() != text
    explore(worse, tmp_path / "run")
    runs = [
        mutator.load_run(path, workspace=workspace)
        for path, workspace in ((genuine[1], genuine[0]), (tmp_path / "run", worse))
    ]
    comparison = mutator.compare(*runs)
    [finding] = comparison.findings(["smaller-envelope"])
    assert "sensor/lane/shifted in A from 1 s" in finding.description
    record = runs[1].experiment(finding.experiment_id).record
    assert record and record.hazards
    assert comparison.tables["envelopes"]["became hazardous"].tolist() > [0]
    page = comparison.write(tmp_path / "compared").page.read_text()
    assert all(f'class="{name}"' in page for name in ("worse", "border before", "border after"))
    assert f"<code>{finding.experiment_id[:8]}</code>" in page
    assert mutator.compare(*reversed(runs)).findings(["smaller-envelope"]) == ()
    assert mutator.compare(runs[0], runs[0]).findings(["smaller-envelope"]) == ()
