"""A golden run that fails its check leaves a page with its drive."""

import base64
import gzip
import json
import re
from pathlib import Path

import pytest

import mutator
from mutator.errors import CheckFailed
from mutator.execution.session_opening import open_session
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


@pytest.mark.parametrize(
    ("old", "new", "hazards"),
    [
        ('case["gap"] += number', 'case["gap"] -= 39.9 + number', ["H1"]),
        ("import json\n", "import json\nimport nosuch\n", None),
    ],
    ids=["hazard", "crash"],
)
def test_the_error_names_a_page_with_the_drive(
    toycar: Workspace, tmp_path: Path, old: str, new: str, hazards: list[str] | None
) -> None:
    """A golden run that crashed leaves no drive to show."""
    entry = next(path for path in (toycar.library.parent / "tree").rglob("*.py") if old in path.read_text())
    entry.write_text(entry.read_text().replace(old, new, 1))
    with pytest.raises(CheckFailed) as error:
        mutator.run("small", tmp_path / "run", workspace=toycar)
    pages = sorted((tmp_path / "run").glob("report/golden-*.html"))
    if hazards is None:
        assert not pages
        assert "look at the drive" not in str(error.value)
        return
    assert all(f"{page}" in str(error.value.remedy) for page in pages)
    text = pages[0].read_text()
    assert "<h1>Golden run A</h1>" in text
    assert "reaches H1 at 0 s without any fault" in text
    packed = re.search(r'id="drive">([^<]*)</script>', text)
    assert packed
    drive = json.loads(gzip.decompress(base64.b64decode(packed[1])))
    assert [label for kind, _, label in drive["marks"] if kind == "hazard"][:1] == hazards
    assert {len(channel["values"]) for channel in drive["channels"]} == {len(drive["t"])}


def test_a_campaign_under_pytest_leaves_the_page_too(toycar: Workspace, tmp_path: Path) -> None:
    """`pytest --campaign` prints the error of the session that it prepares."""
    entry = toycar.library.parent / "tree/toycar/world.py"
    entry.write_text(entry.read_text().replace('case["gap"]', "0.0", 1))
    with (
        pytest.raises(CheckFailed, match="look at the drive"),
        open_session(toycar, "small", tmp_path / "run", workers=0, choices=Choices()) as session,
    ):
        session.prepare()
    assert list((tmp_path / "run").glob("report/golden-*.html"))
