"""Chooses a threshold of the detector as coded from real frames.

Run it as `python -m selfdrive.visiond_lab.choose_threshold FRAMES TRUTH SCENARIOS`: labelled frames as for
`evaluate_on_real_frames`, and the folder of S1.yaml to S5.yaml. The rule was written down before any campaign
was driven with another threshold than 4.0:

Of the thresholds in steps of 0.25 from 0.5 to 6.0, those are safe at which no fault-free run of S1 to S5,
with and without a lead, on both plants, leaves its lane. Frames move as in the paper's setting as coded: on
the reference plant by its authors' rule, on the standard plant by the ground's geometry. Of the safe
thresholds, those that find the most lines are best. Of the best ones, the middle one is chosen, of two middle
ones the upper.

A line is found if its column in row 278 is off by at most the tolerance of `evaluate_on_real_frames`.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2

from selfdrive.common.errors import ConfigError
from selfdrive.messages import CameraView
from selfdrive.sim.picture_options import (
    AUTHORS_CODE_DETECTOR,
    AUTHORS_CODE_TRANSLATION,
    GROUND_TRANSLATION,
    PictureOptions,
)
from selfdrive.sim.scenario import REFERENCE_PLANT, STANDARD_PLANT, Scenario, load_scenario, with_plant
from selfdrive.sim.simulator import Simulator
from selfdrive.visiond import authors_code_detector as coded
from selfdrive.visiond.compiled_authors_code import build_authors_code_detector
from selfdrive.visiond_lab.evaluate_on_real_frames import (
    EXIT_INVALID_INPUT,
    SPACING_TOLERANCE,
    LabelledFrame,
    load_labelled_frames,
)

TRIED_THRESHOLDS = [0.25 * k for k in range(2, 25)]  # log odds
SCENARIO_NAMES = "S1", "S2", "S3", "S4", "S5"
TRANSLATION_BY_PLANT = {STANDARD_PLANT: GROUND_TRANSLATION, REFERENCE_PLANT: AUTHORS_CODE_TRANSLATION}
SEED = 1  # the campaigns'
LEFT_LANE = "H3"


def count_lines(threshold: float, frames: Sequence[LabelledFrame]) -> int:
    """How many of the frames' lines, two each, the detector finds."""
    line_count = 0
    for frame in frames:
        view = CameraView(
            left_lane_y=0.0, right_lane_y=0.0, path_y=0.0, bend=(), lead_d_rel=0.0, picture=frame.grey
        )
        detector = build_authors_code_detector(frame.model, threshold)
        detector.state = nan, nan  # without any edge, the last lines would count
        lines = detector.detect(view)
        limit = SPACING_TOLERANCE * (frame.right_column - frame.left_column)
        columns = (
            (coded.column_of(lines.left.y) - coded.INWARD_PIXELS, frame.left_column),
            (coded.column_of(lines.right.y) + coded.INWARD_PIXELS, frame.right_column),
        )
        line_count += sum(abs(column - true) <= limit for column, true in columns)
    return line_count


def load_scenarios(folder: Path) -> list[Scenario]:
    """S1 to S5, each with and without its lead, on both plants."""
    scenarios = [load_scenario(folder / f"{name}.yaml") for name in SCENARIO_NAMES]
    with_and_without = [s for scenario in scenarios for s in (scenario, replace(scenario, lead=None))]
    return [with_plant(scenario, plant) for plant in TRANSLATION_BY_PLANT for scenario in with_and_without]


def first_departure(
    threshold: float, scenarios: Sequence[Scenario], cache: Path
) -> tuple[Scenario, float] | None:
    """The first of the scenarios in which the car leaves its lane without a fault, and the time (s)."""
    for scenario in scenarios:
        simulator = Simulator()
        options = PictureOptions(
            detector=AUTHORS_CODE_DETECTOR,
            translation=TRANSLATION_BY_PLANT[scenario.plant],
            threshold=threshold,
            cache=cache,
        )
        simulator.reset(scenario, SEED, options)
        while not simulator.is_finished:
            simulator.step()
            t = simulator.hazards.first[LEFT_LANE]
            if t is not None:
                return scenario, t
    return None


def choose(lines: dict[float, int], is_safe: Callable[[float], bool]) -> float | None:
    """The middle of the safe thresholds that find the most lines, of two the upper; None if none is safe."""
    for most in sorted(set(lines.values()), reverse=True):
        best = [threshold for threshold in sorted(lines) if lines[threshold] == most and is_safe(threshold)]
        if best:
            return best[len(best) // 2]
    return None


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.choose_threshold",
        description="Choose the threshold of the detector as coded.",
    )
    parser.add_argument("frames", type=Path, metavar="FRAMES", help="folder of frames")
    parser.add_argument("truth", type=Path, metavar="TRUTH", help="JSON file with the true lines")
    parser.add_argument("scenarios", type=Path, metavar="SCENARIOS", help="folder of S1.yaml to S5.yaml")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    try:
        for line in _report(
            load_labelled_frames(options.frames, options.truth), load_scenarios(options.scenarios)
        ):
            print(line, flush=True)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _report(frames: Sequence[LabelledFrame], scenarios: Sequence[Scenario]) -> Iterator[str]:
    lines = {threshold: count_lines(threshold, frames) for threshold in TRIED_THRESHOLDS}
    for threshold, count in lines.items():
        yield f"{threshold:5.2f}: {count} of {2 * len(frames)} lines found"
    departures = {}
    with TemporaryDirectory() as cache:

        def is_safe(threshold: float) -> bool:
            departures[threshold] = first_departure(threshold, scenarios, Path(cache))
            return departures[threshold] is None

        chosen = choose(lines, is_safe)
    for threshold, departure in departures.items():
        if departure is None:
            yield f"{threshold:5.2f}: no fault-free run leaves its lane"
        else:
            scenario, t = departure
            where = f"{scenario.name}{'' if scenario.lead else ' without lead'} on the {scenario.plant} plant"
            yield f"{threshold:5.2f}: the fault-free run of {where} leaves its lane after {t:.2f} s"
    yield "no threshold is safe" if chosen is None else f"{chosen:.2f}"


if __name__ == "__main__":
    sys.exit(main())
