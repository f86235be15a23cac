"""The fault files that the paper's authors published."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from mutator.onboarding.library_import import LibraryImporter
from mutator.paper.uva_earlier_places import EARLIER_PLACES
from mutator.paper.uva_library import import_fault_files
from mutator.paper.uva_places import VISION_PLACES, HookPlace

# the published files, in the order of the places
_VISION_FILES = (
    *("1", "2", "3", "4", "5, 6", "9", "12", "16", "13", "14", "15", "34", "35", "36", "37", "38"),
    *("43", "44", "45", "46", "47", "39", "40", "41", "42"),
)
_EARLIER_FILES = (
    *(
        "1",
        "2",
        "3",
        "4",
        "5, 6",
        "7",
        "10",
        "8",
        "11",
        "9",
        "12",
        "16",
        "13",
        "14",
        "15",
        "17, 19",
        "18, 20",
    ),
    *("21", "22", "25", "23", "26", "24", "27", "28", "29", "30", "31", "32", "33", "34", "35 to 38"),
)


def _mapping_rows(
    repository: str, places: Iterable[HookPlace], files: Iterable[str]
) -> Iterator[tuple[str, str, str]]:
    for place, numbers in zip(places, files, strict=True):
        effect = "" if place.effect is None else f" (effect {place.effect})"
        changes = ", ".join(f"`{change}`" for change in place.changes) or "`none`"
        becomes = f"`{place.variant}`" if place.is_in_shipped_library else _places_text(place)
        yield (
            f"{repository} {numbers}: `{Path(place.source).name}`, `#{place.hook}`, {changes}{effect}",
            becomes,
            place.refusal or place.note,
        )


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
