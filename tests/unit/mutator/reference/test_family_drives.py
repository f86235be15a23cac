"""The drawings of the shipped families: there are all of them, small, and as the controller drives today."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from mutator._common.files import ScratchFolder
from mutator.reference.family_drives import COLOURS, DRAWINGS_FOLDER, drawn_scenarios, render_drawings
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]
MOST_DRAWING_BYTES = 20_000


def test_each_family_has_a_small_drawing() -> None:
    workspace = Workspace.find(CLONE)
    drawings = sorted((CLONE / DRAWINGS_FOLDER).iterdir())
    assert [path.name for path in drawings] == [f"{name}.svg" for name in workspace.families]
    for path in drawings:
        assert path.stat().st_size <= MOST_DRAWING_BYTES
        curves = [e for e in ElementTree.parse(path).iter() if e.get("stroke") in COLOURS]
        assert len(curves) == 3 * len(COLOURS)
        assert len(drawn_scenarios(workspace.family(path.stem))) == len(COLOURS)


@pytest.mark.slow
def test_drawings_are_up_to_date() -> None:
    with ScratchFolder("drives-") as scratch:
        drawings = dict(render_drawings(Workspace.find(CLONE), scratch))
    stored = {path.name: path.read_text() for path in (CLONE / DRAWINGS_FOLDER).iterdir()}
    assert drawings == stored, "run: python -m mutator.reference.family_drives"
