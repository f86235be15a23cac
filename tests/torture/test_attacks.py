"""Mutants that aim at the harness or at other mutants change no other row, and hang nothing."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from mutator._common.files import remove_folder
from mutator.engines.engine_kinds import OFFERED_ENGINES, REFERENCE
from mutator.errors import EXIT_HARNESS_ERRORS, EXIT_OK
from mutator.model import Status
from mutator.workspace import Workspace

from .misbehaving import ATTACKS, Came, Drawn, Misbehaving, misdeeds

LONGEST_S = 300  # of a command, on a busy machine
TOGETHER = 6  # attacks in one campaign
HITS = (
    "was changed while it was in use",
    "in the tree that ran is not the one of this job",
    "its worker was stopped while it ran",
    "a process of the fork server is gone",
    "the tree of the fork server is not the pristine one",
)
OUTPUTS = ("log.npz", "said.json")
NAMES = [*misdeeds(ATTACKS)]
GROUPS = [NAMES[at : at + TOGETHER] for at in range(0, len(NAMES), TOGETHER)]


class Attacks:
    """Campaigns of ordinary faults with attacks, and the rows of a campaign without any."""

    def __init__(self, toy: Workspace, at: Path) -> None:
        cache = Path(os.environ["XDG_CACHE_HOME"]) / "mutator"
        names = {"CACHE": str(cache), "LIBRARY": str(toy.library), "OUTPUTS": OUTPUTS}
        self.misbehaving = Misbehaving(toy, at, (), misdeeds(ATTACKS, names))
        self.right = self.run(REFERENCE, ()).rows

    def run(self, engine: str, names: Sequence[str]) -> Came:
        drawn = Drawn(engine=engine, workers=2, method="random", names=tuple(names))
        return self.misbehaving.came(drawn, LONGEST_S)

    def problems(self, engine: str, names: Sequence[str]) -> Iterator[str]:
        came, known = self.run(engine, names), self.misbehaving.misdeeds
        noticed = any(known[name].noticed for name in names)
        if came.left or "Traceback" in came.said:
            yield came.left or came.said
        yield from wrong(came.rows, self.right, some=noticed and came.code != EXIT_OK)
        if any("cache" in name for name in names):
            yield from wrong(self.run(engine, ()).rows, self.right, some=False)
        for name in names:
            status = came.status.get(known[name].model)
            hit = is_hit(came.bad.get(known[name].model, ""))  # by another attack
            if status not in known[name].ends and not hit and not (status is None and noticed):
                yield f"{name}: {status}, not {', '.join(known[name].ends)}"
        failed = Status.HARNESS_ERROR in came.status.values()
        if not noticed and came.code != (EXIT_HARNESS_ERRORS if failed else EXIT_OK):
            yield f"exit code {came.code}: {came.said}"


def is_hit(row: str) -> bool:
    return any(why in row for why in HITS)


def wrong(rows: Mapping[str, str], right: Mapping[str, str], *, some: bool) -> Iterator[str]:
    """Yield the rows that differ; with `some`, rows can be missing, or say what was changed."""
    for name, row in right.items():
        found = rows.get(name, "")
        if found != row and not (some and (not found or is_hit(found))):
            yield f"{found}, not {row}"


@pytest.fixture
def attacks(toy: Workspace, tmp_path: Path) -> Iterator[Attacks]:
    yield Attacks(toy, tmp_path / "case")
    remove_folder(tmp_path / "case")  # pytest could not delete it


@pytest.mark.slow
@pytest.mark.parametrize("engine", OFFERED_ENGINES)
@pytest.mark.parametrize("names", GROUPS, ids=lambda names: names[0].replace(" ", "-"))
def test_attacks_change_no_row_of_others(attacks: Attacks, engine: str, names: list[str]) -> None:
    assert [*attacks.problems(engine, names)] == []
