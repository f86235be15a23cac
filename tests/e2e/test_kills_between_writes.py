"""A command that is killed between two of its writes, whichever they are, leaves a folder that opens and that
the same command finishes as if nothing had been."""

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plans import Choices
from mutator.execution.running import run_campaign
from mutator.store.run_folder import RunFolder
from mutator.verification.seal import seal_of
from mutator.workspace import Workspace

CHOICES = Choices(limit=2)
RENAMES = ((Path, "replace"), (Path, "rename"), (shutil, "rmtree"))


class Killed(BaseException):
    """The process is gone."""


class Death:
    """Lets so many changes of names in a run folder happen, and none after them: files appear by being
    renamed. What only scratch is concerned with is not counted."""

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
    """Run two experiments of the toy campaign, or go on with them; the seal."""
    summary = run_campaign(workspace, "small", out, choices=CHOICES, engine="reference")
    assert summary.exit_code == 0
    return summary.seal


def check_kill(workspace: Workspace, out: Path, after: int, expected: tuple[str | None, bytes]) -> bool:
    """Kill a run after so many renames, look at the folder, go on; whether it was killed at all."""
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
    """Seal and table of a run that nobody killed. Its checks are in the cache then."""
    out = tmp_path / "undisturbed"
    found = run(toy, out)
    assert found == seal_of(RunFolder.open(out)) is not None
    return found, (out / "results.csv").read_bytes()


def test_kills_between_two_writes(
    toy: Workspace, tmp_path: Path, undisturbed: tuple[str | None, bytes]
) -> None:
    """While it is planned, while checks are put in place, and while it is finished."""
    for after in (5, 8, 12):
        assert check_kill(toy, tmp_path / str(after), after, undisturbed)


@pytest.mark.slow
def test_every_kill_between_two_writes(
    toy: Workspace, tmp_path: Path, undisturbed: tuple[str | None, bytes]
) -> None:
    """Before the first write, before the second, and so on, to the end."""
    after = 0
    while check_kill(toy, tmp_path / str(after), after, undisturbed):
        after += 1
    assert after >= 14
