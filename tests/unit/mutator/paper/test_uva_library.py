"""Fault files of the paper's authors become specs and campaigns whose places exist in the target."""

from pathlib import Path

import pytest

from mutator.campaigns.campaign_files import load_campaign
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
        ("scenario_52.txt", 3, "imported", "vision_input/uva_52/gaussian", "5 px"),
        ("scenario_52.txt", 4, "imported", "vision_input/uva_52/gain", "1.4"),
        ("scenario_52.txt", 5, "imported", "vision_input/uva_52/gain", "2.8"),
        ("scenario_52.txt", 6, "imported", "vision_input/uva_52/median", "3 px"),
        ("scenario_53.txt", 3, "equal", "vision_output/camera_unavailable/no_data", ""),
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


def test_camera_faults_begin_when_the_file_says_and_latch(library: Workspace) -> None:
    campaign = (library.library / "campaigns" / "uva_t_from_4_and_t_to_20_pictures.yaml").read_text()
    assert "- when: t >= 4 and t <= 20" in campaign and "- spec: vision_input/uva_52/gaussian" in campaign
    assert all(fault.hold == "to_end" for fault in faults(library, "vision_input/uva_52"))


def test_a_fault_has_the_readings_of_the_shipped_one(library: Workspace) -> None:
    """As described, an effect ends with its trigger; as coded, it latches."""
    for reading, hold in (("as_described", None), ("as_coded", "to_end")):
        imported = library.faults("vision_input/uva_52/gaussian", reading=reading)[0]
        shipped = next(
            f for f in library.faults("vision_input/blur/gaussian", reading=reading) if f.value == 5
        )
        assert (imported.hold, imported.reading) == (hold, reading)
        assert [i.location for i in imported.injections] == [i.location for i in shipped.injections]


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
    again = good.replace("fault 2", "fault 3")
    head = "title:1_x-H1\nlocation//selfdrive/test/plant/plant.py//#radar_dRel:HOOK#\n"
    (tmp_path / "scenario_1.txt").write_text(f"{head}{line}\n{good}\n{again}\nTotal number of fault cases: 3")
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


HEAD = "title:1_x-H1\nlocation//selfdrive/{file}//#{hook}:HOOK#\n"
PLANT_HEAD = HEAD.format(file="test/plant/plant.py", hook="radar_dRel")


def folder_with(tmp_path: Path, head: str, *lines: str) -> Path:
    numbered = "".join(f"fault {number}//{line}\n" for number, line in enumerate(lines, start=1))
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / "scenario_1.txt").write_text(f"{head}{numbered}Total number of fault cases: {len(lines)}")
    return folder


def test_variants_at_one_place_are_written_so_that_the_library_loads(tmp_path: Path) -> None:
    """The library's dialect of YAML refuses anchors, which a writer makes for an object that occurs twice."""
    lines = [f"if self.headway_time>={n}://radar_dRel+={n}" for n in (1, 2)]
    import_into_new_library("uva", folder_with(tmp_path, PLANT_HEAD, *lines), tmp_path / "out")
    library = Workspace.find(root=tmp_path / "out")
    assert [fault.value for fault in library.faults("radar/uva_1", reading="as_coded")] == [1, 2]
    campaigns = [load_campaign(path) for name, path in library.campaigns.items() if name.startswith("uva_")]
    assert len(campaigns) == 2
    texts = (path.read_text() for path in library.library.rglob("uva_*.yaml"))
    assert not any("&id" in text or "*id" in text for text in texts)


def test_each_condition_has_a_campaign_of_its_own(tmp_path: Path) -> None:
    limits = ("0.000001", "999999.9", "1234.5678", "1234.5679")
    terms = " and ".join(["self.headway_time<=7"] * 30)
    lines = [f"if self.headway_time<={limit}://radar_dRel+=3" for limit in limits]
    lines += [f"if {terms}://radar_dRel+=3", f"if {terms} and self.headway_time<=8://radar_dRel+=3"]
    imported = import_fault_files(folder_with(tmp_path, PLANT_HEAD, *lines))
    assert imported.count(EntryOutcome.IMPORTED) == len(lines)
    names = {entry.campaign for entry in imported.entries}
    assert names == {Path(name).stem for name in imported.texts if name.startswith("campaigns/")}
    assert len(names) == len(lines) and max(map(len, names)) <= 100


TARGET_SPEED_LINE = "if v_target<(v_cruise * CV.KPH_TO_MS)://{}"


def test_a_condition_at_the_place_is_kept(tmp_path: Path) -> None:
    head = HEAD.format(file="controls/lib/longcontrol.py", hook="output_gb")
    folder = folder_with(tmp_path, head, TARGET_SPEED_LINE.format("output_gb+=0.5"))
    import_into_new_library("uva", folder, tmp_path / "out")
    fault = Workspace.find(root=tmp_path / "out").faults("long_control/uva_1")[0]
    assert [injection.where for injection in fault.injections] == ["plan.source != 'cruise'"]


@pytest.mark.parametrize(
    ("hook", "statement"),
    [("speed", "speed2send-=5//if speed2send<0://  speed2send= 0"), ("radar_none", "none")],
)
def test_a_condition_on_what_the_place_does_not_know_is_refused(
    tmp_path: Path, hook: str, statement: str
) -> None:
    """Neither is the condition left out, also where the fault itself is one of the shipped library."""
    head = HEAD.format(file="test/plant/plant.py", hook=hook)
    entries = import_fault_files(folder_with(tmp_path, head, TARGET_SPEED_LINE.format(statement))).entries
    assert [(entry.line, entry.outcome) for entry in entries] == [(3, EntryOutcome.REFUSED)]
    assert "'plan' in `where` is not known in" in entries[0].reason


def test_the_effect_of_the_camera_can_have_a_point(tmp_path: Path) -> None:
    head = HEAD.format(file="test/plant/maneuver.py", hook="visionFault")
    lines = [f"if self.frameIdx>=500://self.effect={n}//self.thickness=5" for n in ("8.0", "1.0", "1.5")]
    entries = import_fault_files(folder_with(tmp_path, head, *lines)).entries
    assert [entry.name for entry in entries] == [
        "vision_input/uva_1/gaussian",
        "vision_input/uva_1/thickness",
        "",
    ]


def test_a_campaign_names_a_fault_of_two_files_once(tmp_path: Path) -> None:
    """Its experiments are planned once."""
    for number in (1, 2):
        head = HEAD.format(file="test/plant/plant.py", hook="md_none").replace("1_x-H1", f"{number}_x-H3")
        (tmp_path / f"scenario_{number}.txt").write_text(
            f"{head}fault 1//if self.headway_time>=1://none\nTotal number of fault cases: 1"
        )
    imported = import_fault_files(tmp_path)
    assert imported.count(EntryOutcome.EQUAL) == 2
    text = imported.texts["campaigns/uva_hwt_from_1.yaml"]
    assert text.count("spec: vision_output/camera_unavailable/no_data") == 1


def test_a_need_of_the_free_road_makes_no_second_fault(tmp_path: Path) -> None:
    lines = [f"if {need}self.headway_time>=1://v_rel-=3" for need in ("", "not self.lead_relevancy and ")]
    folder = folder_with(tmp_path, PLANT_HEAD.replace("-H1", "-H2"), *lines)
    assert [entry.reason for entry in import_fault_files(folder).entries] == [
        "",
        "the same fault as in line 3",
    ]
