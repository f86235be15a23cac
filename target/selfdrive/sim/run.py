"""Runs one scenario: `python -m selfdrive.sim.run --scenario FILE --out DIR`.

Writes DIR/trace.npz (100 Hz channels) and DIR/record.json (hazards, alerts, engagement, digests). The same
scenario and seed give the same bytes. Exit code 2 for invalid input. The record is written last and
atomically: if it exists, the trace is complete.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from math import isfinite, nan
from pathlib import Path

from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError, writing
from selfdrive.sim.film.film_recorder import FilmOptions
from selfdrive.sim.picture_options import (
    AUTHORS_CODE_DETECTOR,
    DETECTORS,
    GROUND_TRANSLATION,
    MARKS,
    PAPER_DETECTOR,
    SOLID_MARKS,
    TRANSLATIONS,
    PictureOptions,
)
from selfdrive.sim.scenario import PLANTS, Scenario, load_scenario, with_plant
from selfdrive.sim.simulator import STEPS_PER_SECOND, SimulationResult, Simulator
from selfdrive.sim.trace_file import npz_pieces

EXIT_INVALID_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    try:
        run = _open_run(options)
        while not run.done:
            run.step()
        run.write(options.out)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


class SteppedRun:
    """A run in progress, stepped by the caller. It gives the same bytes as the command line."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    @property
    def done(self) -> bool:
        return self._simulator.is_finished

    def step(self) -> None:
        self._simulator.step()

    def recorded(self) -> dict[str, float]:
        return self._simulator.recorder.newest_row()

    def write(self, folder: Path) -> None:
        write_run(self._simulator.result(), folder)


def open_run(arguments: Sequence[str]) -> SteppedRun:
    """Prepare the run that these command line arguments describe.

    `--out` is ignored: `write` takes the folder. Raises ConfigError for invalid input.
    """
    return _open_run(_parse_arguments(arguments))


def _open_run(options: argparse.Namespace) -> SteppedRun:
    scenario = load_scenario(options.scenario)
    if options.no_lead:
        scenario = replace(scenario, lead=None)
    if options.plant:
        scenario = with_plant(scenario, options.plant)
    if options.max_steps is not None:
        scenario = replace(scenario, steps=min(scenario.steps, options.max_steps))
    compiled.use_libraries_in(None if options.forget else options.compiled)
    simulator = Simulator()
    simulator.reset(scenario, options.seed, _picture_options(options), _film_options(options, scenario))
    return SteppedRun(simulator)


def simulate(scenario: Scenario, seed: int, pictures: PictureOptions | None = None) -> SimulationResult:
    simulator = Simulator()
    simulator.reset(scenario, seed, pictures)
    while not simulator.is_finished:
        simulator.step()
    return simulator.result()


def write_run(result: SimulationResult, folder: Path) -> None:
    trace, digest = npz_pieces(result.trace), sha256()
    for piece in trace:
        digest.update(piece)
    record = {**result.record, "trace_digest": digest.hexdigest()}
    with writing(folder, expected="a writable folder", remedy="choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        part, final = folder / "record.json.part", folder / "record.json"
        # First, so that an old record never stands beside a new trace.
        final.unlink(missing_ok=True)
        with (folder / "trace.npz").open("wb") as file:
            file.writelines(trace)
        part.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n")
        part.replace(final)


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.run", description="Run one scenario of the simulator."
    )
    parser.add_argument("--scenario", type=Path, required=True, metavar="FILE", help="scenario YAML")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    parser.add_argument("--seed", type=_parse_seed, default=0, metavar="N", help="seed of all random numbers")
    parser.add_argument("--no-lead", action="store_true", help="run without the lead vehicle")
    parser.add_argument("--plant", choices=PLANTS, help="plant to drive on, instead of the scenario's")
    parser.add_argument("--pictures", action="store_true", help="run with pictures and a lane detector")
    parser.add_argument(
        "--detector", choices=DETECTORS, default=PAPER_DETECTOR, help="lane detector for pictures"
    )
    parser.add_argument(
        "--threshold",
        type=_parse_number,
        metavar="X",
        help="lowest log odds of a window with a mark, for the detector as_coded",
    )
    parser.add_argument("--marks", choices=MARKS, default=SOLID_MARKS, help="the rendered road's right line")
    parser.add_argument("--frames", type=Path, metavar="DIR", help="use your own pictures, not rendered ones")
    parser.add_argument(
        "--translation", choices=TRANSLATIONS, default=GROUND_TRANSLATION, help="how frames follow the car"
    )
    parser.add_argument(
        "--cache", type=Path, metavar="DIR", help="cache pictures and detections in this folder"
    )
    parser.add_argument("--compiled", type=Path, metavar="DIR", help="find compiled code in this folder")
    parser.add_argument("--forget", action="store_true", help="use no cached detections and no compiled code")
    parser.add_argument("--film", type=Path, metavar="DIR", help="record the camera's frames in this folder")
    parser.add_argument(
        "--film-at",
        type=_parse_number,
        action="append",
        default=[],
        metavar="T",
        help="save only the frames that a still at this time (s) needs; repeat for more stills",
    )
    parser.add_argument("--max-steps", type=_parse_positive, metavar="N", help="stop after N steps of 10 ms")
    return parser.parse_args(arguments)


def _film_options(options: argparse.Namespace, scenario: Scenario) -> FilmOptions | None:
    if options.film is None:
        if options.film_at:
            raise ConfigError(
                f"--film-at {options.film_at[0]:g}",
                expected="--film with it",
                remedy="give both, or leave it out",
            )
        return None
    last_t = (scenario.steps - 1) / STEPS_PER_SECOND  # a still at a later time shows the last picture
    return FilmOptions(folder=options.film, still_times=[min(t, last_t) for t in options.film_at])


def _picture_options(options: argparse.Namespace) -> PictureOptions | None:
    if not options.pictures and options.frames:
        raise ConfigError(
            f"--frames {options.frames}", expected="--pictures with it", remedy="give both or none"
        )
    coded = options.pictures and options.detector == AUTHORS_CODE_DETECTOR
    if options.threshold is not None and not coded:
        raise ConfigError(
            f"--threshold {options.threshold:g}",
            expected=f"--pictures and --detector {AUTHORS_CODE_DETECTOR} with it",
            remedy="give all three, or leave it out",
        )
    if not options.pictures:
        return None
    return PictureOptions(
        detector=options.detector,
        marks=options.marks,
        frames=options.frames,
        translation=options.translation,
        threshold=options.threshold,
        cache=options.cache,
        ignore_stored=options.forget,
    )


def _parse_seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 0 or more")
    return int(text)


def _parse_number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = nan
    if not isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def _parse_positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 1 or more")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
