"""Counts that explain differences from the paper: `python benchmarks/what_differs.py DIR/runs`.

Drives nothing: reads the run folders `described`, `coded` and `reference` that `python -m
mutator.paper.reproduce --out DIR` drives. All counts are of guided faults, unless a line says otherwise.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from mutator.results.table_reader import Results
from mutator.statistics.results_frame import prepare_results

TITLES = {"described": "as described", "coded": "as coded", "reference": "as coded, reference plant"}
SATURATED = "steer_saturated"
GROUPS = {
    "fog, brightness, blur": [f"vision_input/{effect}" for effect in ("fog", "brightness", "blur")],
    "rain, snow, occlusion, contrast": [
        f"vision_input/{effect}" for effect in ("rain", "snow", "occlusion", "contrast")
    ],
    "chaff, invisible vehicle, both distances": [
        *("radar/chaff", "radar/invisible_vehicle", "radar_vision/relative_distance")
    ],
    "camera's distance": ["vision_output/relative_distance"],
    "path model": ["vision_output/path_model"],
}
LATE_S = 24.0  # for a hazard of a path model fault that begins later, the run is too short


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0] + ".")
    parser.add_argument("runs", type=Path, metavar="DIR/runs")
    folder = parser.parse_args().runs
    for name, title in TITLES.items():
        print(f"{title}:")
        frame = prepare_results(Results.up_to_date(folder / name).frame())
        for what, text in explaining_counts(frame):
            print(f"  {what}: {text}")


def explaining_counts(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Yield what each count is of, and the counts."""
    active = frame[frame["is_activated"]]
    guided, random = (active[active["method"] == method] for method in ("guided", "random"))
    speed = _of(guided, "car_sensors/speed")
    yield "speed, hazards", _hazards_by(speed, "variant")
    yield "speed, first hazards", _first_hazards_by(speed, "variant")
    yield "invisible vehicle, hazards", _hazards_by(_of(guided, "radar/invisible_vehicle"), "row")
    times = _of(guided, "vision_output/path_model")["reaction_time"].dropna()
    yield "path model, from alert to hazard", f"{times.median():.1f} s, median of {len(times)}"
    path_model = _of(random, "vision_output/path_model")
    begins = (path_model["t_activation"] < LATE_S).map({True: "before", False: "after"})
    yield (
        f"path model, random, {LATE_S:g} s, hazards",
        _hazards_by(path_model.assign(begins=begins), "begins"),
    )
    camera = _of(active, "vision_output/relative_distance")
    yield "camera's distance, both methods, manifested", f"{camera['is_manifested'].sum()} of {len(camera)}"
    unchanged = guided[~guided["is_manifested"]]["kind"].value_counts()
    yield "did not manifest", ", ".join(f"{kind} {count}" for kind, count in unchanged.items())
    yield "alerts", _counts_by(guided, "scenario", "is_alert")
    alone = guided.assign(alone=guided["alerts"] == SATURATED)
    yield f"{SATURATED} as the only alert", _counts_by(alone, "scenario", "alone")
    for title, kinds in GROUPS.items():
        yield f"alerts, {title}", _counts_by(guided[guided["kind"].isin(kinds)], "scenario", "is_alert")
    effects = frame[(frame["module"] == "vision_input") & (frame["method"] == "guided")]
    pairs = effects.groupby(["scenario", "row"])["is_activated"].any()
    yield "camera frames, scenarios and contexts with an activation", f"{pairs.sum()} of {len(pairs)}"


def _of(frame: pd.DataFrame, kind: str) -> pd.DataFrame:
    return frame[frame["kind"] == kind]


def _hazards_by(frame: pd.DataFrame, column: str) -> str:
    return _counts_by(frame, column, "is_hazard")


def _counts_by(frame: pd.DataFrame, column: str, flag: str) -> str:
    rows = frame.groupby(column)[flag]
    return ", ".join(f"{name} {part.sum()} of {len(part)}" for name, part in rows)


def _first_hazards_by(frame: pd.DataFrame, column: str) -> str:
    columns = {f"t_{name}": name.upper() for name in ("h1", "h2", "h3", "h4")}
    texts = []
    for name, part in frame[frame["is_hazard"]].groupby(column):
        firsts = part.rename(columns=columns)[[*columns.values()]].idxmin(axis=1)
        texts.append(f"{name} {', '.join(f'{h} {count}' for h, count in firsts.value_counts().items())}")
    return "; ".join(texts)


if __name__ == "__main__":
    main()
