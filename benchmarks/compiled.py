"""Measure how much time compiled helpers save in runs of 30 s.

`python benchmarks/compiled.py [--rounds N] [--json FILE]`. Runs without and with helpers alternate. Times are
CPU times of this process in one thread.
"""

import argparse
import json
import statistics
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

import cv2  # noqa: E402
from selfdrive.common import compiled  # noqa: E402
from selfdrive.sim.compile_helpers import compile_helpers  # noqa: E402
from selfdrive.sim.detection_memory import FILE_NAME  # noqa: E402
from selfdrive.sim.picture_options import DETECTORS, PictureOptions  # noqa: E402
from selfdrive.sim.run import simulate  # noqa: E402
from selfdrive.sim.scenario import load_scenario  # noqa: E402
from selfdrive.sim.trace_file import npz_pieces  # noqa: E402

KINDS = (None, *DETECTORS)


def run(kind: str | None, cache: Path, helpers: Path | None) -> tuple[float, bytes]:
    """Return CPU seconds and the trace of one run with frames that no other run has used."""
    (cache / FILE_NAME).unlink(missing_ok=True)
    compiled.use_libraries_in(helpers)
    pictures = PictureOptions(detector=kind, cache=cache) if kind else None
    scenario = load_scenario(ROOT / "fault_library/scenarios/S1.yaml")
    start = process_time()
    result = simulate(scenario, 0, pictures)
    return process_time() - start, b"".join(npz_pieces(result.trace))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    figures, same = {}, True
    with TemporaryDirectory() as folder:
        cache, made = Path(folder, "cache"), Path(folder, "compiled")
        for path in compile_helpers(made):
            print(path.name)
        for kind in KINDS:
            run(kind, cache, made)  # imports, frames
            spent: dict[bool, list[float]] = {False: [], True: []}
            for _ in range(options.rounds):
                traces = set()
                for helpers, times in spent.items():
                    seconds, trace = run(kind, cache, made if helpers else None)
                    times.append(seconds)
                    traces.add(trace)
                same &= len(traces) == 1
            without, having = (statistics.median(times) for times in spent.values())
            name = f"{kind} detector, uncached" if kind else "without pictures"
            figures[name] = {"without": spent[False], "with": spent[True]}
            print(f"{name:34} {without:6.2f} s  compiled {having:6.2f} s  ratio {having / without:.2f}")
    print("traces are the same:", same)
    if options.json:
        options.json.write_text(json.dumps({"unit": "s", "runs": figures}, indent=1) + "\n")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
