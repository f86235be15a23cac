"""Measures how well detectors find real lanes in bad weather.

`python -m selfdrive.visiond_lab.evaluate_under_effects FRAMES TRUTH` takes the same input as
`selfdrive.visiond_lab.evaluate_on_real_frames`. Each frame is changed by each level of each effect, once per
seed. The result is the number of pictures in which a detector misses a line; these counts are not
independent, because a frame always shows the same road.
"""

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.errors import ConfigError, writing
from selfdrive.sim.effects.effect import Effect, Moment
from selfdrive.sim.effects.effects_page import draw_level_panel
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond_lab.evaluate_on_real_frames import (
    EXIT_INVALID_INPUT,
    PAPER,
    ROBUST,
    DetectionResult,
    LabelledFrame,
    build_lane_detector,
    detect_lines,
    load_labelled_frames,
    positive_number,
)

SEED_COUNT = 20  # drawings of each effect and level
EFFECT_MOMENT = Moment(2.0, 50.0, 26.82)  # any time and place, at 60 mph
DETECTORS = PAPER, ROBUST
PANELS_PER_ROW = 5  # panels of a strip
CSV_HEADER = "effect", "level", "amount", "unit", "pictures", *(f"missed_{name}" for name in DETECTORS)


class MissedLinesRow(NamedTuple):
    effect: type[Effect]
    level: int
    amount: float
    pictures: int
    missed_counts: tuple[int, ...]


def count_missed_lines(
    frames: Sequence[LabelledFrame], kinds: Sequence[type[Effect]], seeds: int
) -> Iterator[MissedLinesRow]:
    models = {frame.model for frame in frames}
    detectors_by_model = {model: [build_lane_detector(name, model) for name in DETECTORS] for model in models}
    for kind in kinds:
        for level, amount in enumerate(AMOUNTS_BY_EFFECT[kind], 1):
            missed, pictures = np.zeros(len(DETECTORS), int), 0
            for frame, picture in _affected_pictures(frames, kind, amount, seeds):
                has_found = [
                    _detect_without_memory(detector, frame, picture).has_both_lines
                    for detector in detectors_by_model[frame.model]
                ]
                missed += np.logical_not(has_found)
                pictures += 1
            yield MissedLinesRow(kind, level, amount, pictures, tuple(missed.tolist()))


def _detect_without_memory(
    detector: PaperDetector | RobustDetector, frame: LabelledFrame, picture: np.ndarray
) -> DetectionResult:
    initial_state = detector.state
    finding = detect_lines(detector, frame, picture)
    detector.state = initial_state
    return finding


def _affected_pictures(
    frames: Sequence[LabelledFrame], kind: type[Effect], amount: float, seeds: int
) -> Iterator[tuple[LabelledFrame, np.ndarray]]:
    affected_before = None
    for seed in range(1, seeds + 1):
        effect_by_model = {model: kind(amount, seed, model) for model in {frame.model for frame in frames}}
        affected = [effect_by_model[frame.model].apply(frame.grey, EFFECT_MOMENT) for frame in frames]
        if seed == 2 and all(map(np.array_equal, affected, affected_before)):
            return
        affected_before = affected
        yield from zip(frames, affected, strict=True)


def draw_level_strip(frame: LabelledFrame, kind: type[Effect]) -> np.ndarray:
    panels = []
    for level, amount in enumerate(AMOUNTS_BY_EFFECT[kind], 1):
        affected = kind(amount, 1, frame.model).apply(frame.grey, EFFECT_MOMENT)
        panels.append(draw_level_panel(affected, level, amount, kind.UNIT))
    panels += [np.zeros_like(panels[0])] * (-len(panels) % PANELS_PER_ROW)
    rows = [np.hstack(panels[k : k + PANELS_PER_ROW]) for k in range(0, len(panels), PANELS_PER_ROW)]
    return np.vstack(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    kinds = [kind for kind in AMOUNTS_BY_EFFECT if not options.effect or kind.__name__ in options.effect]
    try:
        frames = load_labelled_frames(options.frames, options.truth)
        if options.strips:
            _write_strips(options.strips, frames, kinds)
        else:
            rows = list(_print_rows(count_missed_lines(frames, kinds, options.seeds)))
            if options.csv:
                _write_csv(options.csv, rows)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _print_rows(rows: Iterator[MissedLinesRow]) -> Iterator[MissedLinesRow]:
    print(f"{'effect':<16}{'level':>6}{'amount':>9}{'pictures':>10}", *(f"{n:>8}" for n in DETECTORS))
    for row in rows:
        counts = "".join(f"{count:>9}" for count in row.missed_counts)
        print(
            f"{row.effect.__name__:<16}{row.level:>6}{row.amount:>9g}{row.pictures:>10}{counts}", flush=True
        )
        yield row


def _write_csv(path: Path, rows: Sequence[MissedLinesRow]) -> None:
    with writing(path, expected="a writable file", remedy="choose another --csv"), path.open("w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV_HEADER)
        for row in rows:
            name, unit = row.effect.__name__, row.effect.UNIT
            writer.writerow((name, row.level, f"{row.amount:g}", unit, row.pictures, *row.missed_counts))


def _write_strips(folder: Path, frames: Sequence[LabelledFrame], kinds: Sequence[type[Effect]]) -> None:
    for frame in frames:
        for kind in kinds:
            path = folder / f"{kind.__name__}_{frame.key}.png"
            with writing(path, expected="a writable folder", remedy="choose another --strips"):
                folder.mkdir(parents=True, exist_ok=True)
                path.write_bytes(cv2.imencode(".png", draw_level_strip(frame, kind))[1])


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.evaluate_under_effects",
        description="Count the real frames in which detectors miss a line behind image effects.",
    )
    parser.add_argument("frames", type=Path, metavar="FRAMES", help="folder of frames")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="JSON file with the true lines")
    names = [kind.__name__ for kind in AMOUNTS_BY_EFFECT]
    parser.add_argument(
        "--effect", action="append", choices=names, help="only these effects; can be given several times"
    )
    parser.add_argument(
        "--seeds", type=positive_number, default=SEED_COUNT, help="pictures of each frame and level"
    )
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the counts here")
    parser.add_argument("--strips", type=Path, metavar="DIR", help="write pictures of all levels instead")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
