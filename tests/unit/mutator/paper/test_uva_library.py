"""Fault files of the paper's authors become specs and campaigns whose places exist in the target."""

from pathlib import Path

import pytest

from mutator.checks.library_check import spec_problems
from mutator.errors import MutatorError
from mutator.model import Fault
from mutator.onboarding.library_import import EntryOutcome, import_into_new_library
from mutator.paper.uva_earlier_places import EARLIER_PLACES
from mutator.paper.uva_library import import_fault_files
from mutator.paper.uva_places import VISION_PLACES, HookPlace
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[4]
FILES = ROOT / "tests" / "fixtures" / "uva"
NUMBERS = ("5", "3")  # of a change; also levels that the camera's effects have


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    out = tmp_path_factory.mktemp("imported") / "library"
    import_into_new_library("uva", FILES, out)
    return Workspace.find(root=out)


def faults(library: Workspace, pattern: str) -> tuple[Fault, ...]:
    return library.faults(pattern, reading="as_coded", target="openpilot")


def test_every_line_is_imported_equal_or_refused() -> None:
    entries = import_fault_files(FILES).entries
    assert [(Path(e.file).name, e.line, e.outcome.value, e.name, e.value) for e in entries] == [
        ("scenario_1.txt", 3, "imported", "radar/uva_1/distance", "12 m"),
        ("scenario_1.txt", 4, "imported", "radar/uva_1/distance", "71.5 m"),
        ("scenario_1.txt", 5, "refused", "", ""),
        ("scenario_6.txt", 3, "imported", "radar/uva_6/no_data", ""),
        ("scenario_15.txt", 3, "imported", "vision_output/uva_15/pair", "-0.25, 0.5 m"),
        ("scenario_15.txt", 4, "imported", "vision_output/uva_15/pair", "0.125, 0.5 m"),
        ("scenario_46.txt", 3, "equal", "vision_input/blur/gaussian", "3 px"),
        ("scenario_46.txt", 4, "equal", "vision_input/blur/gaussian", "5 px"),
        ("scenario_46.txt", 5, "equal", "vision_input/blur/gaussian", "7 px"),
    ]
    assert entries[2].reason == "a statement that is not understood: radar_dRel*=2"


def test_an_imported_fault_does_what_that_of_the_shipped_library_does(library: Workspace) -> None:
    """Only the value is the file's: place, model and unit are those of the library's own spec."""
    imported, shipped = (faults(library, name)[0] for name in ("radar/uva_1", "radar/chaff"))
    assert imported.injections[0].location == shipped.injections[0].location
    assert dict(imported.injections[0].params) == {"by": 12.0, "target": "d_rel"}
    assert (imported.unit, imported.aim, imported.changes) == ("m", "H1", ())


def test_each_lane_has_the_value_of_its_own(library: Workspace) -> None:
    pair = faults(library, "vision_output/uva_15")
    assert [[dict(i.params)["per_step"] for i in f.injections] for f in pair] == [[-0.25, 0.5], [0.125, 0.5]]


def test_a_title_for_h2_leaves_out_the_lead(library: Workspace) -> None:
    fault = faults(library, "radar/uva_6")[0]
    assert (fault.aim, fault.changes, fault.hold) == ("H2", ("no_lead",), None)


def test_camera_faults_begin_after_five_seconds_and_latch(library: Workspace) -> None:
    campaign = (library.library / "campaigns" / "uva_t_from_5_and_t_to_30_pictures.yaml").read_text()
    assert "- when: t >= 5 and t <= 30" in campaign and "- spec: vision_input/blur/gaussian" in campaign
    assert all(fault.hold == "to_end" for fault in faults(library, "vision_input/blur/gaussian"))


def file_of(place: HookPlace, condition: str, number: int) -> str:
    """Return a file with one line at that place."""
    values = [str(place.effect), NUMBERS[1]] if place.effect is not None else NUMBERS
    statements = [f"{change}{value}" for change, value in zip(place.changes, values, strict=False)]
    limits = [f"  {text}" if "= " in text and "(" not in text else text for text in place.limits]
    lines = [
        f"title:{number}_x-H2",
        f"location//{place.source}//#{place.hook}:HOOK#",
        f"fault 1//if {condition}://{'//'.join([*statements, *limits] or ['none'])}",
        "Total number of fault cases: 1",
    ]
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("places", "condition"),
    [(VISION_PLACES, "self.headway_time>=1"), (EARLIER_PLACES, "plant.current_time()>3.0")],
    ids=["vision", "earlier"],
)
def test_every_place_of_the_map_exists_in_the_target(
    places: tuple[HookPlace, ...], condition: str, tmp_path: Path
) -> None:
    """A line at each hook can be built into a mutant, or has the reason of the map for its refusal."""
    (tmp_path / "files").mkdir()
    for number, place in enumerate(places, start=1):
        (tmp_path / "files" / f"scenario_{number}.txt").write_text(file_of(place, condition, number))
    entries = import_into_new_library("uva", tmp_path / "files", tmp_path / "out").entries
    assert len(entries) == len(places)
    for place, entry in zip(places, entries, strict=True):
        assert entry.reason == place.refusal
    library = Workspace.find(root=tmp_path / "out")
    specs = [spec for spec in library.specs() if spec.fault_type.startswith("uva_")]
    assert len(specs) == sum(not place.refusal for place in places)
    models, manifest = library.fault_models(), library.manifest("openpilot")
    assert [str(problem) for spec in specs for problem in spec_problems(spec, models, manifest)] == []
    assert library.analysis() is not None


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (
            "fault 1//if not self.lead_relevancy://radar_dRel+=3",
            "its condition needs a free road, but the title",
        ),
        ("fault 1//if self.headway_time>=1://radar_dRel=3", "no place for radar_dRel= at radar_dRel"),
        ("fault 1//if self.headway_time>=1://v_ego+=3", "no place for v_ego+= at radar_dRel"),
        ("fault 1//if self.mood>=1://radar_dRel+=3", "a value that is not observed: self.mood"),
        (
            "fault 1//if self.headway_time>=1://radar_dRel+=3//if radar_dRel>=255://  radar_dRel= 254",
            "no place for radar_dRel+=, if radar_dRel>=255:, radar_dRel= 254 at radar_dRel",
        ),
    ],
)
def test_a_line_without_a_place_is_refused_with_the_reason(tmp_path: Path, line: str, reason: str) -> None:
    good = "fault 2//if self.headway_time>=1://radar_dRel+=3"
    head = "title:1_x-H1\nlocation//selfdrive/test/plant/plant.py//#radar_dRel:HOOK#\n"
    (tmp_path / "scenario_1.txt").write_text(f"{head}{line}\n{good}\n{good}\nTotal number of fault cases: 3")
    refused, imported, repeated = import_fault_files(tmp_path).entries
    assert refused.outcome is EntryOutcome.REFUSED and refused.reason.startswith(reason)
    assert imported.outcome is EntryOutcome.IMPORTED
    assert repeated.reason == "the same fault as in line 4"


def test_pairs_that_share_their_first_value_are_different_variants(tmp_path: Path) -> None:
    """Tables name a fault by its first value, so it must be unique within a variant."""
    head = "title:1_x-H3\nlocation//selfdrive/test/plant/maneuver.py//#md:HOOK#\n"
    lines = [f"fault {n}//if self.headway_time>=1://self.lLane+=1//self.rLane+={n}\n" for n in (1, 2)]
    (tmp_path / "scenario_1.txt").write_text(f"{head}{''.join(lines)}Total number of fault cases: 2")
    names = [entry.name for entry in import_fault_files(tmp_path).entries]
    assert names == ["vision_output/uva_1/pair", "vision_output/uva_1/pair_2"]


def test_files_of_both_repositories_are_not_mixed(tmp_path: Path) -> None:
    """They share hooks with different meanings."""
    for number, hook in ((1, "radar_dRel"), (2, "d_rel")):
        (tmp_path / f"scenario_{number}.txt").write_text(
            f"title:{number}_x-H1\nlocation//selfdrive/test/plant/plant.py//#{hook}:HOOK#\n"
            "fault 1//if self.headway_time>=1://v_rel+=3\nTotal number of fault cases: 1"
        )
    with pytest.raises(MutatorError, match="hook radar_dRel of OpenpilotWithVision among files of UVA"):
        import_fault_files(tmp_path)
