"""Images before and after image effects."""

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mutator._common import cache_layout_and_pruning
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.review import image_effect_pictures
from mutator.review.image_effect_pictures import LEVEL_NAMES, EffectPictures
from mutator.review.mutant_groups import Group, groups_of_library
from mutator.workspace import Workspace

Lit = Callable[..., tuple[Workspace, Group]]


@pytest.fixture
def lit(toycar: Workspace, give_eyes: Callable[..., None]) -> Lit:
    """Give the toy a camera and a fault in its images. Return the workspace and the fault's group."""

    def make(**given: str) -> tuple[Workspace, Group]:
        give_eyes(toycar, **given)
        return toycar, next(g for g in groups_of(toycar) if g.faults)

    return make


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    made: list[str] = []
    execute = ReferenceEngine.execute

    def noted(engine: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        made.append(job.name)
        return execute(engine, job, folder)

    monkeypatch.setattr(ReferenceEngine, "execute", noted)
    return made


def groups_of(workspace: Workspace) -> tuple[Group, ...]:
    return groups_of_library(workspace, workspace.manifest("toycar"), specs=["sensor/light"])


def drawn(workspace: Workspace, group: Group) -> EffectPictures:
    return image_effect_pictures.pictures_of_groups(workspace, workspace.manifest("toycar"), [group])[
        group.id
    ]


def grey(jpeg: bytes) -> float:
    return float(np.asarray(Image.open(io.BytesIO(jpeg))).mean())


def test_an_effect_is_shown_at_three_levels(lit: Lit) -> None:
    workspace, group = lit()
    found = drawn(workspace, group)
    assert grey(found.before_jpeg) == pytest.approx(90, abs=1)
    assert [(one.name, one.label) for one in found.levels] == [
        ("least", "amount 10"),
        ("middle", "amount 40"),
        ("most", "amount 160"),
    ]
    assert [grey(one.after_jpeg) for one in found.levels] == pytest.approx([100, 130, 250], abs=1)


def test_each_level_has_a_pair_of_images(lit: Lit) -> None:
    workspace, group = lit(values="[10, 50]")
    manifest = workspace.manifest("toycar")
    pairs = [
        image_effect_pictures.jpegs_before_and_after(workspace, manifest, group, level)
        for level in (*LEVEL_NAMES, "utmost")
    ]
    assert [pair and round(grey(pair[1])) for pair in pairs] == [100, None, 140, None]
    probe = groups_of(workspace)[-1]
    assert not image_effect_pictures.can_have_pictures(probe)
    assert image_effect_pictures.jpegs_before_and_after(workspace, manifest, probe, "most") is None


def test_images_are_cached_until_an_effect_changes(lit: Lit, runs: list[str]) -> None:
    workspace, group = lit()
    first = drawn(workspace, group)
    runs.clear()
    assert drawn(workspace, group) == first
    assert not runs
    [entry] = cache_layout_and_pruning.cached_image_effects_folder().iterdir()
    entry.write_bytes(entry.read_bytes().replace(b"least", b"lost!"))
    assert drawn(workspace, group) == first
    lens = workspace.library.parent / "tree/toycar/lens.py"
    lens.write_text(lens.read_text().replace("picture + ", "picture - "))
    assert grey(drawn(workspace, group).levels[-1].after_jpeg) == pytest.approx(0, abs=1)
    assert runs == ["pictures-0"] * 2


def test_one_run_of_the_target_draws_all_groups_of_a_place(lit: Lit, runs: list[str]) -> None:
    workspace, group = lit()
    halves = [
        replace(group, id=name, faults=faults)
        for name, faults in (("a", group.faults[:2]), ("b", group.faults[2:5]))
    ]
    found = image_effect_pictures.pictures_of_groups(workspace, workspace.manifest("toycar"), halves)
    assert {name: [one.label for one in made.levels] for name, made in found.items()} == {
        "a": ["amount 10", "amount 20"],
        "b": ["amount 40", "amount 80", "amount 160"],
    }
    assert len(runs) == 1


def test_each_value_is_applied_to_the_original_image(lit: Lit) -> None:
    workspace, group = lit(values="[10, 20, 30]", target="self.picture", place="self.picture")
    assert [round(grey(one.after_jpeg)) for one in drawn(workspace, group).levels] == [100, 110, 120]


def test_amounts_are_ordered_by_their_effect_on_the_image() -> None:
    assert image_effect_pictures._indices_by_severity([1.0, 2.0, 4.0]) == [0, 1, 2]
    assert image_effect_pictures._indices_by_severity([90.0, 40.0, 20.0]) == [2, 1, 0]
    assert image_effect_pictures._indices_by_severity([90.0, 40.0, 1.0, 30.0, 80.0]) == [2, 3, 1, 4, 0]
    assert image_effect_pictures._indices_by_severity([7.0]) == [0]


def test_more_blobs_are_more_severe() -> None:
    """Nine blobs are less severe than ten, even if they cover a larger area."""
    assert image_effect_pictures._indices_by_severity([1.0, 3.0, 2.0, 5.0, 4.0]) == [0, 1, 2, 3, 4]
    assert image_effect_pictures._indices_by_severity([5.0, 3.0, 4.0, 1.0]) == [3, 2, 1, 0]
    assert image_effect_pictures._indices_by_severity([2.0, 2.0]) == [0, 1]


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        ("7.0", r"picture is float of shape \(\), not a grey or RGB picture of bytes"),
        ("1 / 0", "no image of toycar/sensing.py Sensor.sense: ZeroDivisionError"),
    ],
)
def test_an_image_that_cannot_be_drawn_is_reported(lit: Lit, picture: str, said: str) -> None:
    with pytest.raises(MutatorError, match=said):
        drawn(*lit(picture=picture))


def test_a_place_that_no_run_reaches_is_reported(lit: Lit) -> None:
    workspace, _ = lit()
    sensing = workspace.library.parent / "tree/toycar/sensing.py"
    text = sensing.read_text()
    sensing.write_text(text.replace("def sense(self, world):\n", "def sense(self, world):\n        return\n"))
    with pytest.raises(MutatorError, match="the run never reached this function"):
        drawn(workspace, next(g for g in groups_of(workspace) if g.faults))


@pytest.mark.slow
def test_every_image_effect_of_the_library_has_pictures(clone: Workspace, tmp_path: Path) -> None:
    manifest = clone.manifest("openpilot")
    wanted = [
        g
        for g in groups_of_library(clone, manifest, specs=["vision_*/*"])
        if image_effect_pictures.can_have_pictures(g)
    ]
    found = image_effect_pictures.pictures_of_groups(clone, manifest, wanted)
    assert len(found) == len(wanted) >= 20
    assert all(level.after_jpeg != made.before_jpeg for made in found.values() for level in made.levels)
