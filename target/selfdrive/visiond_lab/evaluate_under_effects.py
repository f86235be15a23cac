"""Measures how well detectors find real lanes in bad weather.

`python -m selfdrive.visiond_lab.evaluate_under_effects FRAMES TRUTH` takes the same input as
`selfdrive.visiond_lab.evaluate`. Each frame is changed by each level of each effect, once per seed. The
result is the number of pictures in which a detector misses a line; these counts are not independent, because
a frame always shows the same road.
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
from selfdrive.sim.effects.effects_page import panel
from selfdrive.sim.effects.levels import LEVELS
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector
from selfdrive.visiond_lab.evaluate import (
    EXIT_INVALID_INPUT,
    PAPER,
    ROBUST,
    Finding,
    Frame,
    build,
    look,
    read_frames,
)

SEEDS = 20
MOMENT = Moment(2.0, 50.0, 26.82)
DETECTORS = PAPER, ROBUST
IN_A_ROW = 5  # panels of a strip
HEADS = "effect", "level", "amount", "unit", "pictures", *(f"missed_{name}" for name in DETECTORS)


class Row(NamedTuple):
    kind: type[Effect]
    level: int
    amount: float
    pictures: int
    missed: tuple[int, ...]


def measure(frames: Sequence[Frame], kinds: Sequence[type[Effect]], seeds: int) -> Iterator[Row]:
    models = {frame.model for frame in frames}
    made = {model: [build(name, model) for name in DETECTORS] for model in models}
    for kind in kinds:
        for level, amount in enumerate(LEVELS[kind], 1):
            missed, pictures = np.zeros(len(DETECTORS), int), 0
            for frame, picture in _pictures(frames, kind, amount, seeds):
                found = [_without_a_past(one, frame, picture).good for one in made[frame.model]]
                missed += np.logical_not(found)
                pictures += 1
            yield Row(kind, level, amount, pictures, tuple(missed.tolist()))


def _without_a_past(detector: PaperDetector | RobustDetector, frame: Frame, picture: np.ndarray) -> Finding:
    new = detector.state
    finding = look(detector, frame, picture)
    detector.state = new
    return finding


def _pictures(
    frames: Sequence[Frame], kind: type[Effect], amount: float, seeds: int
) -> Iterator[tuple[Frame, np.ndarray]]:
    before = None
    for seed in range(1, seeds + 1):
        made = {model: kind(amount, seed, model) for model in {frame.model for frame in frames}}
        seen = [made[frame.model].apply(frame.grey, MOMENT) for frame in frames]
        if seed == 2 and all(map(np.array_equal, seen, before)):
            return
        before = seen
        yield from zip(frames, seen, strict=True)


def strip(frame: Frame, kind: type[Effect]) -> np.ndarray:
    panels = []
    for level, amount in enumerate(LEVELS[kind], 1):
        seen = kind(amount, 1, frame.model).apply(frame.grey, MOMENT)
        panels.append(panel(seen, level, amount, kind.UNIT))
    panels += [np.zeros_like(panels[0])] * (-len(panels) % IN_A_ROW)
    rows = [np.hstack(panels[k : k + IN_A_ROW]) for k in range(0, len(panels), IN_A_ROW)]
    return np.vstack(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    kinds = [kind for kind in LEVELS if not options.effect or kind.__name__ in options.effect]
    try:
        frames = read_frames(options.frames, options.truth)
        if options.strips:
            _write_strips(options.strips, frames, kinds)
        else:
            rows = list(_told(measure(frames, kinds, options.seeds)))
            if options.csv:
                _write_csv(options.csv, rows)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _told(rows: Iterator[Row]) -> Iterator[Row]:
    print(f"{'effect':<16}{'level':>6}{'amount':>9}{'pictures':>10}", *(f"{n:>8}" for n in DETECTORS))
    for row in rows:
        counts = "".join(f"{count:>9}" for count in row.missed)
        print(f"{row.kind.__name__:<16}{row.level:>6}{row.amount:>9g}{row.pictures:>10}{counts}", flush=True)
        yield row


def _write_csv(path: Path, rows: Sequence[Row]) -> None:
    with writing(path, expected="a writable file", remedy="choose another --csv"), path.open("w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADS)
        for row in rows:
            name, unit = row.kind.__name__, row.kind.UNIT
            writer.writerow((name, row.level, f"{row.amount:g}", unit, row.pictures, *row.missed))


def _write_strips(folder: Path, frames: Sequence[Frame], kinds: Sequence[type[Effect]]) -> None:
    for frame in frames:
        for kind in kinds:
            path = folder / f"{kind.__name__}_{frame.key}.png"
            with writing(path, expected="a writable folder", remedy="choose another --strips"):
                folder.mkdir(parents=True, exist_ok=True)
                path.write_bytes(cv2.imencode(".png", strip(frame, kind))[1])


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.evaluate_under_effects",
        description="Count the real frames in which detectors miss a line behind image effects.",
    )
    parser.add_argument("frames", type=Path, metavar="FRAMES", help="folder of frames")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="JSON file with the true lines")
    names = [kind.__name__ for kind in LEVELS]
    parser.add_argument(
        "--effect", action="append", choices=names, help="only these effects; can be given several times"
    )
    parser.add_argument("--seeds", type=int, default=SEEDS, help="pictures of each frame and level")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the counts here")
    parser.add_argument("--strips", type=Path, metavar="DIR", help="write pictures of all levels instead")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
