"""A golden run that fails its check leaves a page with its drive."""

import base64
import gzip
import json
import re
from functools import partial
from pathlib import Path

import pytest

import mutator
from mutator.errors import CheckFailed
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.session_opening import open_session
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


@pytest.mark.parametrize(
    ("old", "new", "leaves_trace"),
    [
        ('case["gap"] += number', "case[\"gap\"] += hash('x') % 9 + number", True),
        ("import json\n", "import json\nimport nosuch\n", False),
    ],
    ids=["hash order", "crash"],
)
def test_the_error_names_a_page_with_the_drive(
    toycar: Workspace, tmp_path: Path, old: str, new: str, leaves_trace: bool
) -> None:
    """A golden run that crashed leaves no drive to show."""
    entry = next(path for path in (toycar.library.parent / "tree").rglob("*.py") if old in path.read_text())
    entry.write_text(entry.read_text().replace(old, new, 1))
    with pytest.raises(CheckFailed) as error:
        mutator.run("small", tmp_path / "run", workspace=toycar)
    pages = sorted((tmp_path / "run").glob("report/golden-*.html"))
    if not leaves_trace:
        assert not pages
        assert "look at the drive" not in str(error.value)
        return
    assert all(f"{page}" in str(error.value.remedy) for page in pages)
    text = pages[0].read_text()
    assert "<h1>Golden run A" in text
    assert "two runs that differ in nothing but PYTHONHASHSEED" in text
    packed = re.search(r'id="drive">([^<]*)</script>', text)
    assert packed
    drive = json.loads(gzip.decompress(base64.b64decode(packed[1])))
    assert {len(channel["values"]) for channel in drive["channels"]} == {len(drive["t"])}


def test_a_campaign_under_pytest_leaves_the_page_too(toycar: Workspace, tmp_path: Path) -> None:
    """`pytest --campaign` prints the error of the session that it prepares."""
    entry = toycar.library.parent / "tree/toycar/world.py"
    entry.write_text(entry.read_text().replace('case["gap"]', "case[\"gap\"] + hash('x') % 9", 1))
    run = tmp_path / "run"
    open_run = partial(open_or_freeze_run, toycar, "small", run, Choices(), reviewed=False)
    with (
        pytest.raises(CheckFailed, match="look at the drive"),
        open_session(toycar, open_run, run, workers=0) as session,
    ):
        session.prepare()
    assert list((tmp_path / "run").glob("report/golden-*.html"))
