"""Mutants that aim at the harness or at other mutants change no row of another experiment, and hang nothing."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from mutator._common.files import remove_folder
from mutator.engines.kinds import ENGINES, REFERENCE
from mutator.model import Status
from mutator.workspace import Workspace

from .misbehaving import ATTACKS, Drawn, Misbehaving

METHOD = "random"
WORKERS = 2
LONGEST_S = 120
ROWS_OF_OTHERS = "edits all bytecode and hides it"
HANG = "stops its worker"


@pytest.fixture
def attacks(toy: Workspace, tmp_path: Path, kept_checks: None) -> Iterator[Misbehaving]:
    yield Misbehaving(toy, tmp_path / "case", (), ATTACKS)
    remove_folder(tmp_path / "case")  # pytest could not delete it


def campaign(attacks: Misbehaving, engine: str, *names: str) -> tuple[Mapping[str, str], Mapping[str, Status]]:
    """Run a campaign; return the rows of ordinary faults by experiment, and the status of each attack."""
    came = attacks.came(Drawn(engine=engine, workers=WORKERS, method=METHOD, names=names), LONGEST_S)
    assert not came.left and "Traceback" not in came.said, came
    return came.rows, {name: came.status[attacks.misdeeds[name].model] for name in names}
