"""Where the library, the templates and the targets are found."""

import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError, UnsafePath
from mutator.onboarding.todo_marks import unfilled_mark_errors
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[3]


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to a folder outside any clone, and clear the environment."""
    for name in ("ROOT", "LIBRARY", "TEMPLATES", "TARGET"):
        monkeypatch.delenv(f"MUTATOR_{name}", raising=False)
    place = tmp_path / "elsewhere"
    place.mkdir()
    monkeypatch.chdir(place)
    return place


def test_the_nearest_library_above_the_current_folder_is_found(
    toy: Workspace, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = toy.library.parent
    (root / "templates").mkdir()
    (root / "deep" / "down").mkdir(parents=True)
    monkeypatch.chdir(root / "deep" / "down")
    found = Workspace.find()
    assert (found.library, found.templates) == (root / "fault_library", root / "templates")


def test_options_override_the_environment(
    toy: Workspace, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = toy.library.parent
    (root / "templates").mkdir()
    other = elsewhere / "library"
    other.mkdir()
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    assert Workspace.find().library == root / "fault_library"
    monkeypatch.setenv("MUTATOR_LIBRARY", str(other))
    assert Workspace.find().library == other
    assert Workspace.find(library=root / "fault_library").library == root / "fault_library"
    assert Workspace.find(root).library == root / "fault_library"
    monkeypatch.setenv("MUTATOR_TARGET", str(other))
    assert Workspace.find().target == other
    assert Workspace.find(target=root / "target").target == root / "target"
    assert Workspace.find(str(root), target=str(root / "target")).target == root / "target"


def test_outside_a_clone_the_shipped_library_is_used(elsewhere: Path) -> None:
    found = Workspace.find()
    assert (found.library, found.templates) == (CLONE / "fault_library", CLONE / "templates")
    assert found.manifest("openpilot").root == CLONE / "target"


def test_a_library_without_templates_uses_the_shipped_ones(elsewhere: Path) -> None:
    (elsewhere / "fault_library").mkdir()
    found = Workspace.find()
    assert (found.library, found.templates) == (elsewhere / "fault_library", CLONE / "templates")
    with pytest.raises(MutatorError, match=r"no folder .*elsewhere/templates; expected the templates folder"):
        Workspace.find(root=elsewhere)


def test_a_named_folder_must_exist(elsewhere: Path) -> None:
    with pytest.raises(MutatorError, match=r"no folder .*none; expected the fault_library folder.*`library`"):
        Workspace.find(library=elsewhere / "none", templates=elsewhere)


def test_items_are_found_by_name_or_path(toy: Workspace) -> None:
    assert list(toy.targets) == ["toy"]
    assert list(toy.scenarios) == ["follow"]
    assert list(toy.context_tables) == ["pedals"]
    assert not toy.campaigns
    path = toy.library / "scenarios" / "follow.yaml"
    assert toy.scenario("follow") == toy.scenario(path) == path
    assert toy.spec_files() == (toy.library / "faults" / "sensor" / "distance.yaml",)
    with pytest.raises(
        MutatorError, match=r"no scenario 'folow'; expected one of follow.*did you mean 'follow'"
    ):
        toy.scenario("folow")
    with pytest.raises(
        MutatorError,
        match="no campaign 'x'; expected a known name, but there is none, or the path of a YAML file",
    ):
        toy.campaign("x")


def test_a_name_cannot_lead_out_of_the_library(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match="no fault spec"):
        toy.spec("../targets/toy")


def test_the_path_of_a_spec_file_must_match_its_module_and_fault_type(toy: Workspace) -> None:
    """This keeps the names of specs unique."""
    path = toy.library / "faults" / "sensor" / "distance.yaml"
    path.write_text(path.read_text().replace("fault_type: distance", "fault_type: speed"))
    with pytest.raises(MutatorError, match=r"distance.yaml:2: .*faults/sensor/speed.yaml"):
        toy.specs()


def test_a_workspace_is_displayed_as_a_line_or_as_a_table(toycar: Workspace) -> None:
    assert repr(toycar).endswith("9 fault specs, 2 scenarios, 1 context table, 4 campaigns, 1 target>")
    shown = toycar._repr_html_()
    for name in ("sensor/lane", "near_far", "small", "toycar", str(toycar.templates)):
        assert name in shown


def test_faults_can_be_selected_by_pattern_or_file(toycar: Workspace) -> None:
    names = {fault.spec for fault in toycar.faults("sensor/*")}
    assert names == {
        *("sensor/distance/longer", "sensor/distance/nearer"),
        *("sensor/lane/shifted", "sensor/silence/no_data"),
    }
    whole, variant = toycar.faults("sensor/distance"), toycar.faults("sensor/distance/longer")
    assert variant == tuple(fault for fault in whole if fault.spec == "sensor/distance/longer")
    assert {fault.value for fault in variant} != {
        fault.value for fault in toycar.faults("sensor/distance/longer", seed=1)
    }
    assert toycar.faults(toycar.library / "faults" / "sensor" / "distance.yaml") == whole
    assert {fault.reading for fault in toycar.faults("*/lane/*", reading="as_coded")} == {"as_coded"}
    with pytest.raises(MutatorError, match=r"no fault matches 'sensor/lan'.*did you mean 'sensor/lane'"):
        toycar.faults("sensor/lan")


def test_the_only_target_is_the_default(toycar: Workspace) -> None:
    assert toycar.target_name() == "toycar"
    other = toycar.library / "targets" / "other.yaml"
    text = (toycar.library / "targets" / "toycar.yaml").read_text()
    other.write_text(text.replace("name: toycar", "name: other", 1))
    with pytest.raises(MutatorError, match=r"2 targets in the library \(other, toycar\)"):
        toycar.target_name()
    assert toycar.target_name("other") == "other"
    for path in (toycar.library / "targets").iterdir():
        path.unlink()
    with pytest.raises(MutatorError, match=r"targets: no target manifest"):
        Workspace(library=toycar.library, templates=toycar.templates).target_name()


READS = {  # a file of the library or its templates -> what reads it
    "faults/sensor/lane.yaml": lambda found: found.specs(),
    "scenarios/A.yaml": lambda found: found.scenario("A"),
    "campaigns/small.yaml": lambda found: found.campaign("small"),
    "targets/toycar.yaml": lambda found: found.manifest("toycar"),
    "stpa/contexts/near_far.yaml": lambda found: found.context_table("near_far"),
    "stpa/hazards.yaml": lambda found: found.hazards(),
    "stpa/control_structure.yaml": lambda found: found.analysis(),
    "references/paper_summary.yaml": lambda found: found.references,
    "severity/mine.yaml": lambda found: found._path_by_name("severity"),
    "readings.yaml": lambda found: found.readings(),
    "notes/any.py": lambda found: list(unfilled_mark_errors(found.library)),
    "../templates/offset.yaml": lambda found: found.fault_models(),
    "../templates/offset.py.j2": lambda found: found.fault_models(),
}


FOLDERS = [  # those that are not entered through a link, and those that the user names, are left out
    name for name in READS if name.count("/") and name not in ("faults/sensor/lane.yaml", "notes/any.py")
][:-2]


@pytest.mark.parametrize(
    ("name", "is_folder"), [*((name, False) for name in READS), *((name, True) for name in FOLDERS)]
)
def test_a_library_reads_nothing_outside_through_its_links(
    toycar: Workspace, tmp_path: Path, name: str, is_folder: bool
) -> None:
    """An error must not show the file's content either."""
    path, mine = toycar.library / name, tmp_path / "mine"
    mine.mkdir()
    content = path.read_bytes() if path.exists() else b"# TODO(init): my secret\n"
    (mine / path.name).write_bytes(content + b"# my secret\n")
    link, end = (path.parent, mine) if is_folder else (path, mine / path.name)
    link.parent.mkdir(parents=True, exist_ok=True)
    if link.is_dir():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(end)
    with pytest.raises(UnsafePath, match="a link that leads out of its folder") as caught:
        READS[name](toycar)
    assert "secret" not in str(caught.value)


def test_links_that_stay_in_the_library_are_followed(toycar: Workspace) -> None:
    scenario = toycar.library / "scenarios" / "A.yaml"
    (toycar.library / "shared.yaml").write_bytes(scenario.read_bytes())
    scenario.unlink()
    scenario.symlink_to("../shared.yaml")
    assert toycar.scenario("A").read_bytes() == (toycar.library / "shared.yaml").read_bytes()


@pytest.mark.parametrize(
    "name", [".yaml", "..yaml", "...yaml", "a\u202eb.yaml", "a\nb.yaml", "a\x1b[2J.yaml"]
)
def test_a_scenarios_name_is_a_plain_name(toycar: Workspace, name: str) -> None:
    """Names become folders of golden runs, and are printed."""
    (toycar.library / "scenarios" / name).write_bytes((toycar.library / "scenarios" / "A.yaml").read_bytes())
    with pytest.raises(UnsafePath) as caught:
        _ = toycar.scenarios
    assert str(caught.value).isprintable()
