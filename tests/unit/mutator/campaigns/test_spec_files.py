"""Campaigns with fault specs from outside the library."""

from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.workspace import Workspace


@pytest.fixture
def mine(toycar: Workspace, tmp_path: Path) -> Path:
    """A campaign outside the library, and a spec file in a folder next to it."""
    spec = (toycar.library / "faults" / "sensor" / "lane.yaml").read_text()
    (tmp_path / "specs").mkdir()
    spec = spec.replace("fault_type: lane", "fault_type: drifting")
    (tmp_path / "specs" / "drifting.yaml").write_text(spec)
    text = toycar.campaign("small").read_text()
    text = text.replace("  random_until_s: 5.5\n", "").replace("[guided, random]", "[guided]")
    text = text.replace("spec: sensor/silence/no_data", "{spec: specs/drifting.yaml, values: 2}")
    text = text.replace("canary: {spec: sensor/lane", "canary: {spec: sensor/drifting")
    campaign = tmp_path / "mine.yaml"
    campaign.write_text(text)
    return campaign


def test_a_spec_file_is_found_relative_to_the_campaign(
    toycar: Workspace, mine: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    plan = build_plan(toycar, mine)
    specs = [experiment.fault.spec for experiment in plan.experiments]
    assert specs.count("sensor/drifting/shifted") == 4  # two values, two contexts
    assert specs.count("sensor/lane/shifted") == 2
    assert plan.canary.fault.spec == "sensor/drifting/shifted"


def test_a_missing_spec_file_is_reported(toycar: Workspace, mine: Path) -> None:
    (mine.parent / "specs" / "drifting.yaml").unlink()
    with pytest.raises(
        MutatorError, match=r"mine\.yaml:9: no file .*/specs/drifting\.yaml; expected the path of a spec file"
    ):
        build_plan(toycar, mine)


@pytest.mark.parametrize("linked", [True, False])
def test_a_spec_file_outside_the_campaigns_folder_and_the_library_is_refused(
    toycar: Workspace, mine: Path, tmp_path_factory: pytest.TempPathFactory, linked: bool
) -> None:
    other = tmp_path_factory.mktemp("other") / "notes.yaml"
    other.write_text("secret: [\n")
    if linked:
        (mine.parent / "specs" / "drifting.yaml").unlink()
        (mine.parent / "specs" / "drifting.yaml").symlink_to(other)
    else:
        mine.write_text(mine.read_text().replace("specs/drifting.yaml", str(other)))
    with pytest.raises(
        MutatorError, match=r"mine\.yaml:9: .* is neither below the campaign's folder"
    ) as caught:
        build_plan(toycar, mine)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [("target: toycar", "target: ../toycar.yaml"), ("table: near_far", "table: /etc/near_far.yml")],
)
def test_a_campaign_names_only_targets_and_tables_of_the_library(
    toycar: Workspace, mine: Path, old: str, new: str
) -> None:
    assert old in mine.read_text()
    mine.write_text(mine.read_text().replace(old, new))
    with pytest.raises(MutatorError, match=r"mine\.yaml:\d+: .* expected the name of a file in the library"):
        build_plan(toycar, mine)


def test_two_specs_with_the_same_name_are_refused(toycar: Workspace, mine: Path) -> None:
    """Otherwise, tables could not distinguish their faults."""
    file = mine.parent / "specs" / "drifting.yaml"
    file.write_text(file.read_text().replace("fault_type: drifting", "fault_type: lane"))
    with pytest.raises(MutatorError, match="has the name of a spec in the library, sensor/lane"):
        build_plan(toycar, mine)
    own = toycar.library / "faults" / "sensor" / "lane.yaml"
    text = mine.read_text().replace("specs/drifting.yaml", str(own)).replace("drifting/", "lane/")
    mine.write_text(text)
    assert {e.fault.spec for e in build_plan(toycar, mine).experiments} >= {"sensor/lane/shifted"}


def test_a_missing_campaign_file_is_reported(toycar: Workspace) -> None:
    with pytest.raises(MutatorError, match=r"no file nosuch\.yaml; expected a campaign: the path of a YAML"):
        toycar.campaign("nosuch.yaml")
    with pytest.raises(MutatorError, match=r"no file smal\.yaml.*did you mean 'small'\?"):
        toycar.campaign("smal.yaml")
