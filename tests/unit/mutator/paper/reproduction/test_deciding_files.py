"""Which files can decide a figure of the study, and that the others take no part in its campaigns."""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import pytest

import mutator
from mutator.execution.campaign_running import run_campaign
from mutator.paper.reproduction.study_clone import (
    UNUSED_BY_STUDY_PATHS,
    deciding_files,
    files_deciding_runs,
    files_deciding_study,
)
from mutator.workspace import Workspace

PACKAGE = Path(mutator.__file__).parent


FILES = (
    "mutator/cli/app.py",
    "mutator/comparison/defended_pairs.py",
    "mutator/defences/defence_yaml.py",
    "mutator/model.py",
    "mutator/paper/measures.py",
    "mutator/paper/reproduction/study_check.py",
    "docs/README.md",
    "mutator/report/panel.py",
    "setup.py",
)


def test_a_figure_of_the_study_is_decided_by_fewer_files() -> None:
    """Defences and comparisons decide figures of other pages alone; doors decide none."""
    assert files_deciding_runs(FILES) == ("mutator/model.py", "setup.py")
    assert files_deciding_study(FILES) == ("mutator/model.py", "mutator/paper/measures.py", "setup.py")
    others = {"mutator/cli/app.py", "docs/README.md", "mutator/report/panel.py"}
    assert set(deciding_files(FILES)) == set(FILES) - others


def executed_modules(call: Callable[[], object]) -> set[str]:
    """Return the files of the package that have a function which the call executes, in any thread."""
    files: set[str] = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code.co_name not in ("<module>", "<genexpr>"):
            files.add(frame.f_code.co_filename)

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]
    paths = (Path(file) for file in files)
    return {path.relative_to(PACKAGE.parent).as_posix() for path in paths if path.is_relative_to(PACKAGE)}


@pytest.mark.parametrize("campaign", ["small", "defended"])
def test_only_a_campaign_with_defences_executes_what_reads_them(
    copy_toycar: Callable[[Path], Workspace], tmp_path: Path, campaign: str
) -> None:
    """So a change of these modules changes no campaign of the study, which has none."""
    workspace = copy_toycar(tmp_path)
    executed = executed_modules(lambda: run_campaign(workspace, campaign, tmp_path / "run"))
    assert "mutator/campaigns/plan.py" in executed
    assert not [name for name in executed if name.startswith("mutator/checks/")]
    unused = [name for name in executed if name.startswith(UNUSED_BY_STUDY_PATHS)]
    assert bool(unused) == (campaign == "defended"), unused
