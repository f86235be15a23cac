"""Shows the films of two runs side by side: `python -m selfdrive.sim.film --golden DIR --faulty DIR ...`.

Writes a video for `--out` .mp4 or .gif, or a still at time `--at` for .png or .jpg. Exit code 2 for invalid
input.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2

from selfdrive.common.errors import ConfigError
from selfdrive.sim.film.encode import write_still, write_video
from selfdrive.sim.film.film_events import load_film_events
from selfdrive.sim.film.recorded_film import load_film
from selfdrive.sim.film.side_by_side import SideBySideView

EXIT_INVALID_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    try:
        sheet = SideBySideView(
            load_film(options.golden), load_film(options.faulty), load_film_events(options.events)
        )
        if options.at is not None:
            write_still(sheet.draw(sheet.nearest_index(options.at)), options.out)
        else:
            write_video((sheet.draw(index) for index in range(sheet.picture_count)), options.out)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.film", description="Show the films of two runs side by side."
    )
    parser.add_argument(
        "--golden", type=Path, required=True, metavar="DIR", help="film of the fault-free run"
    )
    parser.add_argument("--faulty", type=Path, required=True, metavar="DIR", help="film of the other run")
    parser.add_argument("--events", type=Path, required=True, metavar="FILE", help="title and marks, JSON")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help=".mp4 or .gif; .png or .jpg with --at"
    )
    parser.add_argument("--at", type=float, metavar="T", help="write one still, at this time in s")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
