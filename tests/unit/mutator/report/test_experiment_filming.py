"""The descriptions of hazards in a film, and the drawing of shots."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Record, Status
from mutator.report.experiment_filming import Shot, _still_times, _write_shots, describe_hazards
from mutator.workspace import Workspace


def test_a_film_describes_a_hazard_as_the_page_does() -> None:
    workspace = Workspace.find(root=Path(__file__).parents[4])
    manifest = workspace.manifest("openpilot")
    assert describe_hazards(workspace, manifest) == {rule.name: rule.about for rule in manifest.hazard_rules}
    assert "touches" in describe_hazards(workspace, manifest)["H1"]


def test_a_film_is_whole_unless_it_is_for_stills_of_a_finished_run(
    record: Callable[..., Record],
) -> None:
    still, video = Shot(path=Path("a.jpg"), t=2.0), Shot(path=Path("a.mp4"))
    finished, crashed = record(), record(status=Status.CRASHED)
    assert _still_times([still, still], finished) == [2.0, 2.0]
    assert _still_times([Shot(path=Path("a.jpg"), t=-3.0)], finished) == [0.0]  # the first picture is shown
    assert _still_times([still, video], finished) == ()
    assert _still_times([still], crashed) == _still_times([still], None) == ()


def test_all_shots_of_a_run_are_drawn_in_one_process(toycar: Workspace, tmp_path: Path) -> None:
    """The first shot that fails ends it; what was drawn before stays."""
    show = toycar.library.parent / "tree" / "toycar" / "show.py"
    text = "import os, sys\nif os.path.exists('2.txt'): sys.exit('error: no third')\n"
    show.write_text(f"{text}open(sys.argv[4], 'w').write(str(os.getpid()))\n")
    places = dict.fromkeys(("golden", "faulty", "events"), "")
    shots = [Shot(path=tmp_path / f"{name}.txt") for name in "abcd"]
    with pytest.raises(MutatorError, match="no third"):
        _write_shots(toycar.manifest("toycar"), tmp_path, places, shots)
    written = [path.read_text() for shot in shots if (path := shot.path).exists()]
    assert len(written) == 3 and len(set(written)) == 1
