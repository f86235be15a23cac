"""The fault files that the paper's authors published."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from mutator.onboarding.library_import import LibraryImporter
from mutator.paper.uva_earlier_places import EARLIER_PLACES
from mutator.paper.uva_library import import_fault_files
from mutator.paper.uva_places import VISION_PLACES, HookPlace

# the published files with lines at a place
_VISION_FILES = {
    "#radar_dRel radar_dRel+=": "1",
    "#radar_dRel v_rel+=": "2",
    "#radar_dRel radar_dRel-=": "3",
    "#radar_dRel v_rel-=": "4",
    "#radar_none none": "5, 6",
    "#speed speed2send-=": "9",
    "#speed speed2send+=": "12",
    "#angle_steer angle_steer2send+=": "16",
    "#md self.lLane+=": "13",
    "#md self.rLane+=": "14",
    "#md self.lLane+=, self.rLane+=": "15",
    "#md_none none": "34",
    "#visionFault self.effect=, self.thickness= 1": "35",
    "#visionFault self.effect=, self.thickness= 2": "36",
    "#visionFault self.effect=, self.thickness= 3": "37",
    "#visionFault self.effect=, self.thickness= 4": "38",
    "#visionFault self.effect=, self.thickness= 5": "43",
    "#visionFault self.effect=, self.thickness= 6": "44",
    "#visionFault self.effect=, self.thickness= 7": "45",
    "#visionFault self.effect=, self.thickness= 8": "46",
    "#visionFault self.effect=, self.thickness= 9": "47",
    "#vision_dRel vision_dRel+=": "39",
    "#vision_dRel vision_dRel-=": "40",
    "#RadVis_dRel d_rel+=": "41",
    "#RadVis_dRel d_rel-=": "42",
}
_EARLIER_FILES = {
    "#d_rel d_rel+=": "1",
    "#d_rel v_rel+=": "2",
    "#d_rel d_rel-=": "3",
    "#d_rel v_rel-=": "4",
    "#radar_none none": "5, 6",
    "#d_rel tracks[ids].dRel+=": "7",
    "#d_rel tracks[ids].dRel-=": "10",
    "#d_rel tracks[ids].vRel+=": "8",
    "#d_rel tracks[ids].vRel-=": "11",
    "#speed speed2send-=": "9",
    "#speed speed2send+=": "12",
    "#angle_steer self.angle_steer+=": "16",
    "#md self.lLane+=": "13",
    "#md self.rLane+=": "14",
    "#md self.lLane+=, self.rLane+=": "15",
    "#apply_brake apply_brake=": "17, 19",
    "#apply_gas apply_gas=": "18, 20",
    "#apply_steer apply_steer=": "21",
    "#a_target a_target+=": "22",
    "#a_targetH2 a_target-=": "25",
    "#v_target v_target+=": "23",
    "#v_target v_target-=": "26",
    "#output_gb output_gb+=": "24",
    "#output_gb output_gb-=": "27",
    "#plr_poly p_poly[3]+=": "28",
    "#plr_poly l_poly[3]+=": "29",
    "#plr_poly r_poly[3]+=": "30",
    "#d_poly self.d_poly[3]+=": "31",
    "#angle_steers_des self.angle_steers_des+=": "32",
    "#output_steer output_steer+=": "33",
    "#md_none none": "34",
    "#visionFault none": "35 to 38",
}


def _mapping_rows(
    repository: str, places: Iterable[HookPlace], files: Mapping[str, str]
) -> Iterator[tuple[str, str, str]]:
    for place in places:
        effect = "" if place.effect is None else f" (effect {place.effect})"
        changes = ", ".join(f"`{change}`" for change in place.changes) or "`none`"
        numbers = files[_lines_at(place)]
        becomes = f"`{place.variant}`" if place.is_in_shipped_library else _places_text(place)
        yield (
            f"{repository} {numbers}: `{Path(place.source).name}`, `#{place.hook}`, {changes}{effect}",
            becomes,
            place.refusal or place.note,
        )


def _lines_at(place: HookPlace) -> str:
    """Return what the lines at a place have in common: hook, changes, and the camera's effect."""
    effect = "" if place.effect is None else f" {place.effect}"
    return f"#{place.hook} {', '.join(place.changes) or 'none'}{effect}"


def _places_text(place: HookPlace) -> str:
    if place.refusal:
        return "refused"
    return " and ".join(
        f"`{injection['model']}` in `{injection['at']['function']}` ({_anchor_text(injection['at'])})"
        for injection in place.body["injections"]
    )


def _anchor_text(at: dict[str, str]) -> str:
    kind, name = next((key, text) for key, text in at.items() if key not in ("file", "function"))
    return f"{kind} `{name}`" if name else kind


LIBRARY_IMPORTER = LibraryImporter(
    about="fault files of UVA-DSA/OpenpilotWithVision and UVA-DSA/openpilot, by the authors of the paper",
    read=import_fault_files,
    mapping=(
        *_mapping_rows("vision", VISION_PLACES, _VISION_FILES),
        *_mapping_rows("0.3.8.2", EARLIER_PLACES, _EARLIER_FILES),
    ),
)
