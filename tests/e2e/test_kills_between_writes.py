"""A command killed between two writes leaves a folder that opens and resumes."""

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from mutator.audit.run_digests_and_seal import seals_of
from mutator.execution.campaign_running import run_campaign
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

CHOICES = Choices(limit=2)
RENAMES = ((Path, "replace"), (Path, "rename"), (shutil, "rmtree"))


class Killed(BaseException):
    """Raised instead of ending the process."""


class Death:
    """Let `after` renames and deletions in a run folder pass, then fail all others. Each file is put in place
    by a rename. Scratch files are not counted."""

    def __init__(self, run: Path, after: int, patch: pytest.MonkeyPatch) -> None:
        self.left, self._run = after, run
        for owner, name in RENAMES:
            patch.setattr(owner, name, self._counting(getattr(owner, name)))

    def _counting(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def work(path: Path, *more: Any, **options: Any) -> Any:
            place = Path(more[0] if more and isinstance(more[0], Path) else path)
            counts = place.is_relative_to(self._run) and "work" not in place.relative_to(self._run).parts
            if counts and self.left <= 0:
                self.left = -1
                raise Killed
            self.left -= counts
            return real(path, *more, **options)

        return work


def run(workspace: Workspace, out: Path) -> str | None:
    summary = run_campaign(workspace, "small", out, choices=CHOICES, engine="reference")
    assert summary.exit_code == 0
    return summary.seal


def check_kill(workspace: Workspace, out: Path, after: int, expected: tuple[str | None, bytes]) -> bool:
    """Kill a run after `after` renames, check the folder and resume. Return whether the run was killed."""
    with pytest.MonkeyPatch.context() as patch:
        death = Death(out, after, patch)
        with suppress(Killed, AssertionError):
            run(workspace, out)
    if RunFolder.exists(out):
        assert RunFolder.open(out).problems() == []
    assert (run(workspace, out), (out / "results.csv").read_bytes()) == expected
    return death.left < 0


@pytest.fixture
def undisturbed(toy: Workspace, tmp_path: Path) -> tuple[str | None, bytes]:
    out = tmp_path / "undisturbed"
    found = run(toy, out)
    assert found == seals_of(RunFolder.open(out)).seal is not None
    return found, (out / "results.csv").read_bytes()


@pytest.mark.slow
def test_a_kill_between_any_two_writes_does_no_harm(
    toy: Workspace, tmp_path: Path, undisturbed: tuple[str | None, bytes]
) -> None:
    after = 0
    while check_kill(toy, tmp_path / str(after), after, undisturbed):
        after += 1
    assert after >= 14
