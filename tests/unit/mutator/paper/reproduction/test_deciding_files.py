"""Which files can decide a figure of the study, and that the others take no part in its campaigns."""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import pytest

import mutator
from mutator.execution.campaign_running import run_campaign
from mutator.paper.reproduction.study_clone import DEFENCES_PATH, deciding_files, files_deciding_runs
from mutator.workspace import Workspace

PACKAGE = Path(mutator.__file__).parent


def test_doors_comparisons_and_defences_decide_no_figure() -> None:
    files = (
        "mutator/cli/app.py",
        "mutator/comparison/defended_pairs.py",
        "mutator/defences/defence_yaml.py",
        "mutator/model.py",
        "docs/README.md",
        "mutator/report/panel.py",
        "setup.py",
    )
    assert deciding_files(files) == ("mutator/model.py", "setup.py")
    assert files_deciding_runs(("mutator/paper/measures.py", *files)) == ("mutator/model.py", "setup.py")


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
    assert not [name for name in executed if name.startswith(("mutator/checks/", "mutator/comparison/"))]
    of_defences = [name for name in executed if name.startswith(DEFENCES_PATH)]
    assert bool(of_defences) == (campaign == "defended"), of_defences
