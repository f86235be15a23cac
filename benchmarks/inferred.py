"""Drive cells that finished explorations only inferred, and compare.

`python benchmarks/inferred.py RUN... [--most 200] [--seed 1]`. A cell is inferred if a shorter fault of the
same size reached a hazard while it was active, so that the longer one must reach it at the same time. The
cells are drawn from those of all runs together, without replacement. The runs are of the shipped target, as
described.
"""

import argparse
import random
import tempfile
from collections.abc import Iterator
from pathlib import Path

import mutator
from mutator.api.exploration_benches import experiment_builder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.cell_results import CellState
from mutator.explore.lattice import Cell

TARGET, READING = "openpilot", "as_described"
GOAL_RUNS = 200


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--most", type=int, default=GOAL_RUNS)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    inferred = [(e, cell) for path in options.runs for e in explored(path) for cell in inferred_cells(e)]
    drawn = random.Random(options.seed).sample(inferred, min(options.most, len(inferred)))
    wrong = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        mutator.open_bench(
            None, Path(folder) / "run", campaign="survived", after_hazard="stop", workers=2
        ) as bench,
    ):
        selected = SelectedTarget.of(None, TARGET)
        experiments = [experiment_of(selected, envelope, cell) for envelope, cell in drawn]
        records = {record.experiment_id: record for record in bench.run(experiments)}
    for (envelope, cell), experiment in zip(drawn, experiments, strict=True):
        hazards, expected = dict(records[experiment.id].hazards), expected_hazard(envelope, cell)
        if hazards.get(expected[0]) is None or abs(hazards[expected[0]] - expected[1]) > 1e-6:
            wrong += 1
            print(f"WRONG: {experiment.label}: {hazards}, expected {expected}", flush=True)
    print(f"{len(drawn)} of {len(inferred)} inferred cells driven (goal {GOAL_RUNS}), {wrong} wrong (goal 0)")
    return int(wrong > 0)


def explored(path: Path) -> tuple[mutator.Envelope, ...]:
    return mutator.load_run(path).envelopes


def inferred_cells(envelope: mutator.Envelope) -> Iterator[Cell]:
    for i, line in enumerate(envelope.cells):
        yield from ((i, j) for j, state in enumerate(line) if state is CellState.INFERRED)


def experiment_of(selected: SelectedTarget, envelope: mutator.Envelope, cell: Cell) -> mutator.Experiment:
    build = experiment_builder(selected, READING, envelope.exploration.section.observe_s)
    (line, duration), start_s = cell, envelope.drive.start_s
    return build(envelope.plane, envelope.magnitudes[line], start_s, envelope.durations_s[duration])


def expected_hazard(envelope: mutator.Envelope, cell: Cell) -> tuple[str, float]:
    """Return the hazard that a shorter fault reached while it was active, and its time in the drive."""
    duration_s = envelope.durations_s[cell[1]]
    for (line, _), result in envelope.exploration.map.results.items():
        needed_s, time_s = result.inferred_from_s, result.time_to_hazard_s
        if line == cell[0] and needed_s is not None and needed_s <= duration_s and time_s is not None:
            return result.hazard, envelope.drive.start_s + time_s
    raise AssertionError(f"{envelope.plane.spec}, {cell}: nothing proves it")


if __name__ == "__main__":
    raise SystemExit(main())
