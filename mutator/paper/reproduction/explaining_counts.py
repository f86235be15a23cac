"""Counts of a campaign that explain its differences from the paper."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mutator.paper.fault_type_rank_agreement import GUIDED
from mutator.statistics.guided_against_random import RANDOM

if TYPE_CHECKING:
    import pandas as pd

_SATURATED = "steer_saturated"
_CAMERA_DISTANCE = "vision_output/relative_distance"
_FAR_VEHICLES = ("radar/ghost_vehicle", "radar_vision/relative_distance")
_PATH_MODEL = "vision_output/path_model"
_LATE_S = 24.0  # if a fault begins later, less than 6 s of the run are left


def count_runs(frame: "pd.DataFrame") -> Iterator[tuple[str, str]]:
    """Yield what is counted, and the count, from the frame of usable results. The faults are guided and
    activated, unless the words say otherwise.
    """
    active = frame[frame["is_activated"]]
    guided, random = (active[active["method"] == method] for method in (GUIDED, RANDOM))
    speed = guided[guided["kind"] == "car_sensors/speed"]
    for variant in ("slower", "faster"):
        yield (
            f"speed, {variant}: hazards, and the first ones",
            _hazards_by_kind(speed[speed["variant"] == variant]),
        )
    invisible = guided[guided["kind"] == "radar/invisible_vehicle"]
    for context in ("C1", "C2", "C3", "C4"):
        yield (
            f"invisible vehicle in {context}: hazards",
            _count_of(invisible[invisible["row"] == context], "is_hazard"),
        )
    path_model = random[random["kind"] == _PATH_MODEL]
    is_late = path_model["t_activation"] >= _LATE_S
    yield f"path model, random, before {_LATE_S:g} s: hazards", _count_of(path_model[~is_late], "is_hazard")
    yield "path model, random, later: hazards", _count_of(path_model[is_late], "is_hazard")
    times = guided[guided["kind"] == _PATH_MODEL]["reaction_time"].dropna()
    yield (
        "path model: median time from alert to hazard",
        f"{times.median():.2f} s of {len(times)}" if len(times) else "-",
    )
    distances = active[active["kind"] == _CAMERA_DISTANCE]
    yield "camera's distance, both methods: manifested", _count_of(distances, "is_manifested")
    unchanged = guided[~guided["is_manifested"]]
    is_explained = unchanged["kind"].isin((_CAMERA_DISTANCE, *_FAR_VEHICLES))
    what = "not manifested: camera's distance, and vehicles of radar or of radar and camera"
    yield what, f"{is_explained.sum()} of {len(unchanged)}"
    pictures = guided[guided["module"] == "vision_input"]
    yield "camera frames: alerts", _count_of(pictures, "is_alert")
    pairs = len(pictures[["scenario", "row"]].drop_duplicates())
    yield "camera frames: scenarios and contexts with an activated fault", str(pairs)
    alerts = guided[guided["is_alert"]]
    yield f"alerts: {_SATURATED} alone", f"{(alerts['alerts'] == _SATURATED).sum()} of {len(alerts)}"
    if "t_h4" in active:
        yield "H4, which the paper does not have, both methods", str(active["t_h4"].notna().sum())
    hazards = guided[guided["is_hazard"]]
    yield "hazards: without an alert before", f"{hazards['reaction_time'].isna().sum()} of {len(hazards)}"


def _count_of(frame: "pd.DataFrame", flag: str) -> str:
    return f"{frame[flag].sum()} of {len(frame)}"


def _hazards_by_kind(frame: "pd.DataFrame") -> str:
    """Return text such as `30 of 30 (H3 30)`; a run counts for its first hazard."""
    columns = {name: name.removeprefix("t_").upper() for name in map(str, frame) if _is_hazard_time(name)}
    firsts = frame[frame["is_hazard"]][[*columns]].idxmin(axis=1).map(columns).value_counts(sort=False)
    kinds = ", ".join(f"{kind} {count}" for kind, count in firsts.sort_index().items())
    return _count_of(frame, "is_hazard") + (f" ({kinds})" if kinds else "")


def _is_hazard_time(name: str) -> bool:
    return name.startswith("t_h") and name.removeprefix("t_h").isdigit()
