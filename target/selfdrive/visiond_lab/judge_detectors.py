"""Judges what detectors say about lane lines behind image effects: found, wrong, or abstained.

`python -m selfdrive.visiond_lab.judge_detectors` judges rendered roads that are in no training, and with
`--frames FRAMES TRUTH` (as for `selfdrive.visiond_lab.evaluate_on_real_frames`) real ones. Each frame is
judged clean and behind three levels of effects: of each effect, or on a road, of every third in turn. A
detector abstains from a line if its probability is below MIN_CONFIDENT. Shares are of the lines of which at
least half of the pixels are seen; confident wrong lines where less can be seen are counted apart. A detector
has no memory of earlier pictures.
"""

import argparse
import csv
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import isnan, sqrt
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError, writing
from selfdrive.messages import CameraView
from selfdrive.sim.compile_helpers import COMPILED_FOLDER
from selfdrive.sim.effects.effect import Effect
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.remembering_detector import DetectorWithState
from selfdrive.visiond.compiled_paper import build_paper_detector
from selfdrive.visiond.compiled_robust import build_robust_detector
from selfdrive.visiond.detector import LaneLines
from selfdrive.visiond.line_confidence import MIN_CONFIDENT
from selfdrive.visiond_lab.evaluate_on_real_frames import (
    EXIT_INVALID_INPUT,
    PAPER,
    ROBUST,
    load_labelled_frames,
    positive_number,
)
from selfdrive.visiond_lab.judged_frames import (
    MIN_SEEN_SHARE,
    SIDES,
    JudgedFrame,
    affect_frame,
    judged_real_frame,
    measure_seen_shares_behind_effect,
    render_frames,
)

JUDGED_ROADS, JUDGED_SEED = 500, (47, 1)  # training uses other seeds
REAL_FRAME_SEEDS = 10  # drawings of each effect and level
ROAD_TURNS = 3  # an effect is judged on every third road
CLEAN = "clean"
BUILDERS = {PAPER: build_paper_detector, ROBUST: build_robust_detector}


class Judgement(NamedTuple):
    """What a detector says about one line. `seen_share` is that of its pixels, `prob` the detector's."""

    detector: str
    effect: str
    level: int
    seen_share: float
    is_right: bool
    prob: float


def judged_levels(kind: type[Effect]) -> list[int]:
    """Levels 1, 5 and 10, or the mildest, a middle one and the strongest."""
    count = len(AMOUNTS_BY_EFFECT[kind])
    return sorted({1, (count + 1) // 2, count})


def judge(
    frames: Iterable[JudgedFrame],
    kinds: Sequence[type[Effect]],
    *,
    seeds: int,
    turns: int,
    detectors: Sequence[str],
) -> Iterator[Judgement]:
    """Judge each frame clean, and with `seeds` drawings of the levels of the effects whose turn it is."""
    for number, frame in enumerate(frames):
        built = {name: BUILDERS[name](frame.model) for name in detectors}
        clean_shares = frame.measure_seen_shares(frame.picture, frame.without_lines)
        yield from _judge_picture(built, frame, frame.picture, clean_shares, (CLEAN, 0))
        for kind in kinds[number % turns :: turns]:
            for level, k in product(judged_levels(kind), range(seeds)):
                amount, seed = AMOUNTS_BY_EFFECT[kind][level - 1], 1 + number * seeds + k
                picture = affect_frame(frame, kind, amount, seed)
                shares = measure_seen_shares_behind_effect(frame, kind, amount, seed)
                yield from _judge_picture(built, frame, picture, shares, (kind.__name__, level))


def _judge_picture(
    built: Mapping[str, DetectorWithState],
    frame: JudgedFrame,
    picture: np.ndarray,
    shares: Sequence[float],
    effect: tuple[str, int],
) -> Iterator[Judgement]:
    for name, detector in built.items():
        lines = detect_without_memory(detector, picture)
        for side in SIDES:
            if not isnan(shares[side]):
                line = (lines.left, lines.right)[side]
                yield Judgement(name, *effect, shares[side], frame.is_right(side, line), line.prob)


def detect_without_memory(detector: DetectorWithState, picture: np.ndarray) -> LaneLines:
    initial_state = detector.state
    lines = detector.detect(
        CameraView(left_lane_y=0.0, right_lane_y=0.0, path_y=0.0, bend=(), lead_d_rel=0.0, picture=picture)
    )
    detector.state = initial_state
    return lines


class Verdicts(NamedTuple):
    """Counts of the lines that can be seen, and of wrong confident lines where they cannot."""

    detector: str
    effect: str
    level: int
    seen_count: int
    found_count: int
    wrong_count: int
    abstained_count: int
    unseen_count: int
    unseen_wrong_count: int


def count_verdicts(judgements: Iterable[Judgement]) -> list[Verdicts]:
    counts: dict[tuple[str, str, int], list[int]] = {}
    for judgement in judgements:
        count = counts.setdefault(judgement[:3], [0] * 6)
        is_confident = judgement.prob >= MIN_CONFIDENT
        if judgement.seen_share >= MIN_SEEN_SHARE:
            count[0] += 1
            count[1] += is_confident and judgement.is_right
            count[2] += is_confident and not judgement.is_right
            count[3] += not is_confident
        else:
            count[4] += 1
            count[5] += is_confident and not judgement.is_right
    return [Verdicts(*key, *count) for key, count in sorted(counts.items())]


def wilson_interval(share: float, n: int) -> tuple[float, float]:
    """The 95 % interval of a share that was counted in `n` independent cases."""
    z = 1.96
    middle, half = share + z * z / (2 * n), z * sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    compiled.use_libraries_in(COMPILED_FOLDER)
    kinds = [kind for kind in AMOUNTS_BY_EFFECT if not options.effect or kind.__name__ in options.effect]
    try:
        if options.frames:
            labelled = load_labelled_frames(*options.frames)
            frames, seeds, turns = [judged_real_frame(frame) for frame in labelled], REAL_FRAME_SEEDS, 1
        else:
            frames, seeds, turns = render_frames(options.roads, JUDGED_SEED), 1, ROAD_TURNS
        judgements = judge(
            frames,
            kinds,
            seeds=options.seeds or seeds,
            turns=turns,
            detectors=options.detector or list(BUILDERS),
        )
        verdicts = count_verdicts(judgements)
        _print(verdicts, 2 * len(frames) if options.frames else 2 * options.roads)
        if options.csv:
            _write_csv(options.csv, verdicts)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _print(verdicts: Sequence[Verdicts], lines: int) -> None:
    print(
        f"{'detector':<9}{'effect':<16}{'level':>5}{'seen':>7}{'found':>8}{'95 % interval':>18}{'wrong':>8}"
        f"{'abstained':>10}{'unseen':>8}{'wrong':>7}"
    )
    for v in verdicts:
        n = max(v.seen_count, 1)
        low, high = wilson_interval(v.found_count / n, max(min(n, lines), 1))
        print(
            f"{v.detector:<9}{v.effect:<16}{v.level:>5}{v.seen_count:>7}"
            f"{v.found_count / n:8.1%}{low:9.1%} to{high:6.1%}{v.wrong_count / n:8.1%}"
            f"{v.abstained_count / n:10.1%}{v.unseen_count:>8}{v.unseen_wrong_count:>7}"
        )
    for name in sorted({v.detector for v in verdicts}):
        of_detector = [v for v in verdicts if v.detector == name and v.seen_count]
        wrong = max((v.wrong_count / v.seen_count for v in of_detector), default=0.0)
        gain = largest_gain(of_detector)
        print(f"{name}: at most {wrong:.1%} wrong; against the order of levels by {gain:.1%}")


def largest_gain(verdicts: Sequence[Verdicts]) -> float:
    """By how much the share found at a stronger level of an effect exceeds that at a milder one."""
    gains = [
        strong.found_count / strong.seen_count - mild.found_count / mild.seen_count
        for mild, strong in product(verdicts, verdicts)
        if mild.effect == strong.effect
        and mild.level < strong.level
        and mild.seen_count
        and strong.seen_count
    ]
    return max([0.0, *gains])


def _write_csv(path: Path, verdicts: Sequence[Verdicts]) -> None:
    with writing(path, expected="a writable file", remedy="choose another --csv"), path.open("w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Verdicts._fields)
        writer.writerows(verdicts)


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.judge_detectors",
        description="Judge the lines that detectors find behind image effects.",
    )
    parser.add_argument("--frames", type=Path, nargs=2, metavar=("FRAMES", "TRUTH"), help="judge real frames")
    parser.add_argument("--roads", type=positive_number, default=JUDGED_ROADS, help="rendered roads to judge")
    names = [kind.__name__ for kind in AMOUNTS_BY_EFFECT]
    parser.add_argument("--effect", action="append", choices=names, help="only these; can be repeated")
    parser.add_argument("--detector", action="append", choices=list(BUILDERS), help="only these")
    parser.add_argument("--seeds", type=positive_number, help="drawings of each effect and level")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the counts here")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
