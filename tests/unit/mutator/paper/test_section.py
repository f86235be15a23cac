"""The published observations as a run's report tells them: which of them its experiments can decide."""

import shutil
from pathlib import Path

import pytest

from mutator.campaigns.plans import Choices, freeze, make_plan
from mutator.paper.published import load_paper
from mutator.paper.section import told
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from ..statistics.results_frame import results

REFERENCES = Path(__file__).parents[4] / "fault_library" / "references"


@pytest.mark.parametrize("shard", [None, "1/2"])
def test_a_part_of_a_plan_is_not_its_mixture(toycar: Workspace, tmp_path: Path, shard: str | None) -> None:
    """Claims of all faults wait for the last experiment of the plan, of which a shard is but a part."""
    shutil.copytree(REFERENCES, toycar.library / "references")
    freeze(make_plan(toycar, "small", Choices(shard=shard)), tmp_path / "run", toycar)
    folder = RunFolder.open(tmp_path / "run")
    kinds = [kind.split("/") for _, kind in load_paper(REFERENCES).coverage]
    frame = results(*({"module": m, "fault_type": kind, "seed": i} for i, (m, kind) in enumerate(kinds)))
    for done in (folder.planned - 1, folder.planned):
        made = told(folder, toycar, frame, done)
        assert made is not None
        of_all = [one for each in made.observations for one in each.claims if one.claim.mixture]
        whole = done == 12
        why = "" if whole else f"only {done} of the 12 experiments of the plan have been run"
        assert {one.why for one in of_all} == {why}
        assert whole or all(one.verdict.value == "cannot be told" for one in of_all)
