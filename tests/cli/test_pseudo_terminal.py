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
from mutator.checks.findings import CheckState, Finding, FindingPlace
from mutator.cli.console import Terminal
from mutator.cli.progress_display import campaign_progress
from mutator.model import Experiment, ObservedActivation, Outcome, Status
from mutator.report.report_builder import WrittenReport
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace

from .pseudo_terminal import lines_on_screen, pseudo_terminal, run_in_terminal

CLONE = Path(__file__).parents[2]
SCREENS = Path(__file__).parent / "terminal"
WIDTHS = (80, 100, 120, 160)
VARYING = re.compile(r"\b[0-9a-f]{64}\b")  # digests of today's tree
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
}
HAZARDS = (("H1", 19.01), ("H3", 20.5))
WRITTEN = WrittenReport(markdown=Path("REPORT.md"), page=Path("index.html"), rows=60)
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


@pytest.fixture(scope="module")
def screens(
    write_run: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[tuple[str, int], str]]:
    """What commands have shown, in a folder with two finished runs of quickstart with made-up results."""
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
        patch.setattr(mutator.Run, "report", lambda run, **_options: WRITTEN)
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
        yield {}


def screen(name: str, width: int, screens: dict[tuple[str, int], str]) -> str:
    """Return what a terminal of so many columns shows; each command runs once for each width."""
    if (name, width) not in screens:
        code, lines = run_in_terminal(width, *COMMANDS[name])
        assert code in (0, 1, 2), "\n".join(lines)
        screens[name, width] = "\n".join(VARYING.sub("<varies>", line) for line in lines) + "\n"
    return screens[name, width]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_terminal_shows(name: str, screens: dict[tuple[str, int], str]) -> None:
    """No screen differs from the one that was read."""
    shown = "\n".join(f"===== {width} columns\n{screen(name, width, screens)}" for width in WIDTHS)
    path = SCREENS / f"{name}.txt"
    if os.environ.get("UPDATE_TERMINALS"):
        SCREENS.mkdir(exist_ok=True)
        path.write_text(shown, encoding="utf-8")
    assert shown == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", COMMANDS)
def test_no_id_name_or_number_is_broken(name: str, screens: dict[tuple[str, int], str]) -> None:
    """Every word of a narrow screen is a word of a screen that is wide enough for everything."""
    whole = words_of(screen(name, 1000, screens))
    for width in WIDTHS:
        assert not words_of(screen(name, width, screens)) - whole


def words_of(screen: str) -> set[str]:
    lines = [line for line in screen.splitlines() if not line.startswith("not shown: ")]
    return {word for line in lines for word in line.split() if set(word) - set("─\\")}


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
