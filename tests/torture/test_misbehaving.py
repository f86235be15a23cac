"""With any misbehaving mutants, the command ends in time and leaves nothing behind. Ordinary experiments have
their results, and every engine gives the same verdict."""

import resource
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mutator._common.files import remove_folder
from mutator.workspace import Workspace

from .misbehaving import Misbehaving
from .tally import Tally

pytestmark = pytest.mark.slow

TRIES = 80  # campaigns, of up to three misdeeds each
MOST_MEMORY = 8 << 30  # of any process, to protect the machine


def test_misdeeds_do_not_disturb_ordinary_faults(
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally | str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    wanted = seeds(TRIES)
    misbehaving = Misbehaving(toy, tmp_path / "case", wanted)
    tally = Tally("mutants that misbehave")
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, limits[1]))
    try:
        tally.drive(wanted, misbehaving.cases)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
        remove_folder(tmp_path / "case")  # pytest could not delete it
    print_tally(tally)
    print_tally(misbehaving.table())
    assert not tally.wrong
