"""Compare the time of a frame in a run between this version and an older one.

`python benchmarks/pictures.py CLONE`. CLONE is a checkout of the older commit. Each version has its own
interpreter, compiled helpers and empty cache. The versions process new frames alternately. It prints the CPU
time of moving a frame to the car's pose, applying the image effect and detecting lines, and the ratio. A
detector or effect that the older version lacks is left out. A case in which the versions find different lines
is reported.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from math import sin
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from selfdrive.sim.truth import GroundTruth

ROOT = Path(__file__).resolve().parents[1]
HELPERS = ("-m", "selfdrive.sim.compile_helpers")
EFFECTS: dict[str, tuple[str, float] | None] = {
    "clean": None,
    "paper's rain": ("PaperRain", 5),
    "paper's snow": ("PaperSnow", 5),
    "mild rain": ("Rain", 5),
    "strong rain": ("Rain", 100),
    "mild snow": ("Snow", 1),
    "strong snow": ("Snow", 6),
    "rain as coded": ("CodedRain", 5),
    "snow as coded": ("CodedSnow", 5),
}


class Version:
    """A checkout and the process that makes its frames."""

    def __init__(self, clone: Path, scratch: Path) -> None:
        env = os.environ | {"PYTHONPATH": str(clone / "target"), "OPENBLAS_NUM_THREADS": "1"}
        python = [sys.executable, *HELPERS]
        said = subprocess.run([*python, "--help"], env=env, check=True, capture_output=True, text=True)
        option = "--cache" if "--cache" in said.stdout else "--out"
        subprocess.run([*python, option, scratch], env=env, check=True, stdout=subprocess.DEVNULL)
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--take", scratch], env=env, text=True, stdin=-1, stdout=-1
        )
        self.detectors, self.effects = self.ask("has")

    def ask(self, *words: object) -> Any:
        assert self._process.stdout is not None
        print(json.dumps(words), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def end(self) -> None:
        self._process.communicate()


def answers(cache: Path) -> Iterator[object]:
    """Yield the answers to the parent's requests: existing detectors and effects, or the times and lines of
    frames.
    """
    import cv2
    from selfdrive.common import compiled
    from selfdrive.sim import effects

    cv2.setNumThreads(1)
    names = vars(compiled)
    use = names.get("use_libraries_in") or names["use"]  # older versions have the latter
    use(cache)
    cases: dict[tuple[str, str], Drive] = {}
    for line in sys.stdin:
        kind, *words = json.loads(line)
        if kind == "has":
            yield (
                choices().DETECTORS,
                [k for k, made in EFFECTS.items() if not made or hasattr(effects, made[0])],
            )
        else:
            detector, effect, count = words
            case = cases.get((detector, effect)) or Drive(detector, effect, cache)
            yield cases.setdefault((detector, effect), case).pictures(count)


def choices() -> ModuleType:
    """Return the module of a version that lists its detectors and translations."""
    return first_module("picture_options", "pictures", "vision")


def first_module(*names: str) -> ModuleType:
    """Return the first module of the simulator that this version has; older versions have the later names."""
    paths = (f"selfdrive.sim.{name}" for name in names)
    return next(import_module(path) for path in paths if find_spec(path))


class Drive:
    """Frames with an effect, from a moving car that never repeats a pose."""

    def __init__(self, detector: str, effect: str, cache: Path) -> None:
        from selfdrive.sim import effects
        from selfdrive.sim.road import Road

        coded = detector == "as_coded"
        move = "as_coded" if coded else "ground"
        options = getattr(choices(), "PictureOptions", None) or choices().Pictures  # as in older versions
        pictures = options(detector=detector, cache=cache, translation=move)
        module = first_module("camera_and_detector", "vision")
        build = getattr(module, "build_camera_and_detector", None) or module.build_vision
        self._seen = build(pictures, Road(None, None), 0)
        self._offset = 0.1 * list(EFFECTS).index(effect)  # cases share no poses
        self._number = 0
        self._effect = None
        if made := EFFECTS[effect]:
            name, amount = made
            self._effect = getattr(effects, name)(amount, 1, self._seen.model).ready()

    def pictures(self, count: int) -> tuple[list[float], str]:
        """Return the CPU time (ms) of that many frames and a digest of their lines."""
        times, lines = [], sha256()
        for _ in range(count):
            truth = self._truth()
            began = process_time()
            view = self._seen.camera.look(truth)
            if self._effect:
                view = view._replace(picture=self._effect.apply(view.picture, truth))
            found = self._seen.detector.detect(view)
            times.append(1000.0 * (process_time() - began))
            lines.update(repr([tuple(line[:3]) for line in found]).encode())
        return times, lines.hexdigest()

    def _truth(self) -> "GroundTruth":
        from selfdrive.sim.truth import GroundTruth

        k = self._number = self._number + 1
        place = {"t": 2.0 + 0.05 * k, "v_ego": 26.82, "position": 1.341 * k}
        pose = {"lateral_offset": 0.4 * sin(0.071 * k + self._offset), "heading": 0.01 * sin(0.113 * k)}
        others: dict[str, Any] = dict.fromkeys(GroundTruth._fields, 0.0)
        return GroundTruth(**others | place | pose)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clone", type=Path, nargs="?", help="checkout of the older commit")
    parser.add_argument("--take", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--detectors", nargs="+", metavar="NAME", help="measure only these detectors")
    parser.add_argument("--effects", nargs="+", choices=EFFECTS, default=list(EFFECTS), metavar="NAME")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--count", type=int, default=20, help="pictures per round")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    if options.take:
        for answer in answers(options.take):
            print(json.dumps(answer), flush=True)
        return 0
    if options.clone is None:
        parser.error("CLONE is missing")
    figures = {}
    with ExitStack() as stack:
        versions = []
        for clone in (options.clone.resolve(), ROOT):
            versions.append(Version(clone, Path(stack.enter_context(TemporaryDirectory()))))
            stack.callback(versions[-1].end)
        older, this = versions
        for detector in options.detectors or [name for name in this.detectors if name in older.detectors]:
            for effect in [name for name in options.effects if name in older.effects]:
                figures[f"{detector}, {effect}"] = _compared(versions, detector, effect, options)
    if options.json:
        options.json.write_text(json.dumps({"unit": "ms", "pictures": figures}, indent=1) + "\n")
    return 0


def _compared(
    versions: list[Version], detector: str, effect: str, options: argparse.Namespace
) -> list[list[float]]:
    times: list[list[float]] = [[], []]
    same = True
    for number in range(options.rounds + 1):
        lines = set()
        for which in (0, 1) if number % 2 else (1, 0):
            took, digest = versions[which].ask("pictures", detector, effect, options.count)
            times[which] += took if number else []  # the first round warms up
            lines.add(digest)
        same &= len(lines) == 1
    older, this = map(median, times)
    told = "" if same else "  different lines"
    print(
        f"{detector:10}{effect:16}{older:8.2f} ms, now {this:8.2f} ms: ratio {this / older:.2f}{told}",
        flush=True,
    )
    return times


if __name__ == "__main__":
    sys.exit(main())
