"""What each command shows in a real pseudo-terminal of 80, 100, 120 and 160 columns.

`terminal/` has the screens as text. If your change alters them, write them with
`UPDATE_TERMINALS=1 pytest tests/cli/test_pseudo_terminal.py`, and read the difference.
"""

import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator._common.cache_layout_and_pruning import CacheEntry
from mutator.api.run_experiments import RunExperiment
from mutator.checks.check_findings import CheckState, Finding, FindingPlace
from mutator.cli.progress_display import campaign_progress
from mutator.cli.terminal_output import Terminal
from mutator.model import Experiment, ObservedActivation, Outcome, Status
from mutator.report.report_builder import WrittenReport
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace

from .pseudo_terminal import lines_on_screen, lines_to_copy, pseudo_terminal, run_in_terminal

CLONE = Path(__file__).parents[2]
SCREENS = Path(__file__).parent / "terminal"
WIDTHS = (80, 100, 120, 160)
VARYING = re.compile(r"\b[0-9a-f]{64}\b|(?<=took )\d+ s\b")  # digests of today's tree, durations
WITH_DIGESTS_OF_TREES = ("verify", "generate")  # also as their first 16 digits
DIFF = re.compile(r"^diff --git .*?\n(?![-+ @d\n])", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:^  |: )((?:mutator|patch -p1) .*)$", re.MULTILINE)
TO_COPY = re.compile(r"^  (mutator|patch) |^[\w .]+:? +<varies>$|\{function: .*\}$")
LOST_UNIT = re.compile(r"\d\n\s*(?:s|ms|m|m/s|m/s\^2|mph|deg|px|%|MB|min)(?![\w/])")
IN_TOY = ["--root", "toy", "--limit", "3", "-n", "0", "--no-stills"]
TOY_RUN = ["toy", "--out", "runs/toy", *IN_TOY]
COMMANDS = {
    "list-specs": ["list", "specs"],
    "list-models": ["list", "models"],
    "list-campaigns": ["list", "campaigns"],
    "list-triggers": ["list", "triggers"],
    "list-targets": ["list", "targets"],
    "places": ["places", "selfdrive/sim/radar.py"],
    "stpa": ["stpa"],
    "plan": ["plan", "quickstart", "--out", "planned", "-n", "2", "--limit", "12"],
    "review-list": ["review", "list", "--spec", "radar_vision/*", "--spec", "radar/ghost_vehicle"],
    "review-show": ["review", "show", "--spec", "radar/ghost_vehicle", "5e65276e"],
    "review-status": ["review", "status", "--spec", "radar/*"],
    "show-worst": ["show", "--run", "runs/before"],
    "show-experiment": ["show", "103e4cb1", "--run", "runs/before"],
    "show-ambiguous": ["show", "", "--run", "runs/before"],
    "report": ["report", "runs/before"],
    "history": ["report", "runs"],
    "compare": ["compare", "runs/before", "runs/after", "--fail-on", "new-hazard"],
    "verify": ["verify", "runs/before"],
    "cache": ["cache"],
    "check": ["check"],
    "doctor": ["doctor"],
    "help-show": ["show", "--help"],
    "run": ["run", *TOY_RUN],
    "rerun": ["rerun", "8c70", "--root", "toy", "--run", "runs/toy"],
    "seal": ["seal", "runs/toy"],
    "merge": ["merge", "runs/part1", "runs/part2", "--out", "runs/whole"],
    "try": ["try", "radar/chaff", "--scenario", "S1", "--trigger", "C2"],
    "diff": ["diff", "radar_vision/relative_distance", "--trigger", "C2"],
    "generate": ["generate", "radar/chaff", "--trigger", "C2", "--out", "mutants"],
    "export": ["export", "runs/before", "--format", "junit"],
    "init": ["init", "faults"],
}
NEW_FOLDERS = ("runs/whole", "mutants", "faults")  # which commands refuse to overwrite
HAZARDS = (("H1", 19.01), ("H3", 20.5))
CACHE_ENTRIES = [
    CacheEntry(what=what, path=Path(f"cache/{size}"), size=size, used=0.0)
    for what, size in (("goldens", 48_123_456), ("goldens", 51_200_000), ("lines", 700))
]
FINDINGS = [
    Finding(name="python", level=CheckState.OK, found="3.11.7 at /home/somebody/project/.venv/bin/python"),
    Finding(
        name="fast engines, openpilot",
        level=CheckState.WARN,
        found="runs cannot be forked: the target starts a thread",
        remedy="install it with `pip install 'some-package>=1.2'`, or use `--engine reference`",
        places=(
            FindingPlace(
                file="selfdrive/controls/lib/longitudinal_planner.py", line=12, what="in Planner.update"
            ),
        ),
    ),
]
CONTACT = {"outcome": Outcome.HAZARD, "hazards": HAZARDS, "t_manifest": 12.4, "t_end": 19.01}
ACTIVE = {"activation": ObservedActivation(first=12.31, last=19.6, count=731)}


def endings(experiment: Experiment, hazardous: str) -> dict[str, Any]:
    """Return a made-up result: experiments whose ids end with one of `hazardous` end in a hazard."""
    if experiment.id[-1] in hazardous:
        alerts = (("steer_saturated", 18.02),) if experiment.id[-2] in "02468ace" else ()
        return CONTACT | ACTIVE | {"alerts": alerts, "metrics": (("delta_v", 4.25), ("margin_h1", -0.162))}
    if experiment.id[-1] in "67":
        return {
            "outcome": None,
            "status": Status.CRASHED,
            "detail": "ZeroDivisionError: float division",
        } | ACTIVE
    return {"outcome": Outcome.SDC, "t_manifest": 12.4} | ACTIVE


def made_up_report(run: mutator.Run, **_options: object) -> WrittenReport:
    folder = run.path / "report"
    return WrittenReport(markdown=folder / "REPORT.md", page=folder / "index.html", rows=60)


@pytest.fixture(scope="module")
def screens(
    write_run: Callable[..., Path],
    copy_toycar: Callable[[Path], Workspace],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[dict[tuple[str, int], str]]:
    """What commands have shown, in a folder with two finished runs of quickstart with made-up results, and
    real runs of the toy car.
    """
    folder = tmp_path_factory.mktemp("terminal")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in ("fault_library", "templates", "target"):  # here, so that paths are short and the same
            shutil.copytree(CLONE / name, name, ignore=shutil.ignore_patterns("__pycache__"))
        patch.setenv("MUTATOR_ROOT", str(folder))
        patch.setenv("TERM", "xterm-256color")
        for name in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):
            patch.delenv(name, raising=False)
        # reports draw figures, and the machine differs
        patch.setattr(mutator.Run, "report", made_up_report)
        patch.setattr(mutator, "doctor", lambda workspace: FINDINGS)
        patch.setattr(mutator, "check_library", lambda workspace, target: [])
        patch.setattr(mutator, "check_target", lambda workspace, **options: FINDINGS)
        patch.setattr(mutator, "cache_folder", lambda: Path("cache"))
        patch.setattr(mutator, "cache_entries", lambda: CACHE_ENTRIES)
        workspace = Workspace.find(folder)
        for name, hazardous in (("before", "01"), ("after", "012")):
            write_run(
                workspace,
                Path("runs") / name,
                lambda e, hazardous=hazardous: endings(e, hazardous),
                campaign="quickstart",
            )
            run_in_terminal(80, "show", "--run", f"runs/{name}")  # so that its tables are built
        patch.setattr(mutator, "try_fault", cached_by(str, mutator.try_fault))
        patch.setattr(RunExperiment, "rerun", cached_by(lambda run: run.id, RunExperiment.rerun))
        copy_toycar(folder)
        for shard in ("1", "2"):
            run_in_terminal(
                80, "run", "small", "--out", f"runs/part{shard}", "--shard", f"{shard}/2", *IN_TOY
            )
        _, text = run_in_terminal(80, "run", *TOY_RUN)
        yield {("run-start", 80): VARYING.sub("<varies>", text)}


def cached_by(key: Callable[[Any], str], function: Callable[..., Any]) -> Callable[..., Any]:
    """Let each run happen once, not once for each width. `key` tells calls apart by their first argument."""
    results: dict[str, Any] = {}

    def call(first: Any, *arguments: Any, **options: Any) -> Any:
        name = key(first)
        if name not in results:
            results[name] = function(first, *arguments, **options)
        return results[name]

    return call


def sent(name: str, width: int, screens: dict[tuple[str, int], str]) -> str:
    """Return what a terminal of so many columns is sent; each command runs once for each width."""
    if (name, width) not in screens:
        for folder in NEW_FOLDERS:
            shutil.rmtree(folder, ignore_errors=True)
        code, text = run_in_terminal(width, *COMMANDS[name])
        assert code in (0, 1, 2), text
        if name in WITH_DIGESTS_OF_TREES:
            text = re.sub(r"\b[0-9a-f]{16}\b", "<varies.16chars>", text)
        screens[name, width] = VARYING.sub("<varies>", text)
    return screens[name, width]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_terminal_shows(name: str, screens: dict[tuple[str, int], str]) -> None:
    """No screen differs from the one that was read."""
    shown = "\n".join(
        "\n".join([f"===== {width} columns", *lines_on_screen(sent(name, width, screens), width), ""])
        for width in WIDTHS
    )
    compare_with_screen(name, shown)


def test_a_new_run_shows(screens: dict[tuple[str, int], str]) -> None:
    """What stays on the screen when the bars are gone."""
    compare_with_screen("run-start", "\n".join(lines_on_screen(screens["run-start", 80], 80)) + "\n")


def compare_with_screen(name: str, shown: str) -> None:
    path = SCREENS / f"{name}.txt"
    if os.environ.get("UPDATE_TERMINALS"):
        SCREENS.mkdir(exist_ok=True)
        path.write_text(shown, encoding="utf-8")
    assert shown == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", COMMANDS)
def test_no_id_name_or_number_is_broken(name: str, screens: dict[tuple[str, int], str]) -> None:
    """Every word of a narrow screen is a word of a screen that is wide enough for everything. Only what is
    there to be copied is longer than the screen: a line of a diff, a command, a digest, a place.
    """
    whole = words_of(sent(name, 1000, screens))
    for width in WIDTHS:
        text = sent(name, width, screens)
        assert not words_of(text) - whole
        for line in DIFF.sub("", "\n".join(lines_to_copy(text))).splitlines():
            assert len(line) <= width or TO_COPY.search(line), line


@pytest.mark.parametrize("name", COMMANDS)
def test_no_number_loses_its_unit(name: str, screens: dict[tuple[str, int], str]) -> None:
    """No line ends with a number whose unit begins the next one."""
    for width in WIDTHS:
        text = "\n".join(lines_to_copy(sent(name, width, screens)))
        assert not LOST_UNIT.search(text), LOST_UNIT.search(text)


@pytest.mark.parametrize("name", COMMANDS)
def test_diffs_and_commands_are_whole(name: str, screens: dict[tuple[str, int], str]) -> None:
    """They are the same at every width, so they can be copied: a diff as a patch, a command to a shell."""
    for pattern in (DIFF, COMMAND):
        copies = [
            pattern.findall("\n".join(lines_to_copy(sent(name, width, screens)))) for width in (80, 1000)
        ]
        assert copies[0] == copies[1]


def words_of(text: str) -> set[str]:
    lines = [line for line in lines_to_copy(text) if not line.startswith("not shown: ")]
    return {word for line in lines for word in line.split() if set(word) - set("─")}


@pytest.mark.parametrize("width", WIDTHS)
def test_a_warning_stands_above_the_progress_bar(width: int, screens: object) -> None:
    """The bar is gone in the end; the warning is whole, and no number of the bar is cut on the way."""
    warning = "warning: no golden run reaches the trigger of 7 of 60 experiments, it says (C3 in S1: 2)"
    outcomes = Counter(hazard=8, masked=3, not_activated=6, sdc=16)
    with pseudo_terminal(width) as received, campaign_progress(Terminal()) as notify:
        notify(Progress(stage="experiments", done=33, total=60, outcomes=outcomes, per_s=0.9, remaining_s=29))
        Terminal().print_note(warning)
    text = b"".join(received).decode()
    assert " ".join(" ".join(lines_on_screen(text, width)).split()) == warning
    assert "33/60" in text and "29 s left" in text and "…" not in text
