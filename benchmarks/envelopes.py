"""Compare envelopes of the shipped target with the whole lattices.

`python benchmarks/envelopes.py [--points 51] [--planes N] [--islands]`. Each plane is explored; then all
its cells are driven. With `--islands`, the planes are those that have islands: hazardous cells, at least
three, that no other hazardous cell touches, also at corners, but the largest such group. A cell is wrong
if the exploration called it hazardous and it is not, or the other way round. It is far from the border if
no cell beside it, also at corners, is of the other kind.
"""

import argparse
import tempfile
from itertools import product
from pathlib import Path

import mutator
from mutator.api.exploration_benches import experiment_builder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.cell_results import CellState, judge_cell
from mutator.explore.lattice import Cell

TARGET, READING = "openpilot", "as_described"
PLANES = (  # fault, scenario, start in s
    ("car_sensors/speed/slower", "S5_long", 12.0),
    ("car_sensors/steer/angle", "S1_long", 5.0),
    ("radar_vision/relative_distance/longer", "S3_long", 8.0),
    ("vision_output/path_model/left", "S2_long", 6.0),
    ("software/timing/stale", "S5_long", 4.0),
)
ISLANDS = (  # with a lead also where the spec asks for a free road
    ("software/timing/stale", "S5_long", 4.0),
    ("software/timing/dropped", "S5_long", 4.0),
    ("car_sensors/speed/faster", "S5_long", 12.0),
    ("radar/chaff/distance", "S5_long", 12.0),  # 230 to 254 m: five lines of `--points 200`
)
LEAST_ISLAND = 3
GOALS = {"search": 120, "cells / runs": 12.0}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--points", type=int, default=51)
    parser.add_argument("--planes", type=int)
    parser.add_argument("--islands", action="store_true")
    options = parser.parse_args()
    is_good, planes = True, ISLANDS if options.islands else PLANES
    with tempfile.TemporaryDirectory() as folder:
        for number, (fault, scenario, start_s) in enumerate(planes[: options.planes]):
            out = Path(folder) / str(number)
            explored = mutator.envelope(
                fault,
                scenario,
                start_s,
                out / "explored",
                points=options.points,
                campaign="survived",
                workers=2,
            )
            for envelope in explored:
                is_good &= show(envelope, drive_all(envelope, out / "whole"))
    return int(not is_good)


def drive_all(envelope: mutator.Envelope, out: Path) -> list[list[CellState]]:
    """Drive every cell of an envelope's lattice; return the states by magnitude and duration."""
    lattice, observe_s = envelope.exploration.map.lattice, envelope.exploration.section.observe_s
    build = experiment_builder(SelectedTarget.of(None, TARGET), READING, observe_s)
    with mutator.open_bench(None, out, campaign="survived", after_hazard="stop", workers=2) as bench:
        cells = [
            build(envelope.plane, magnitude, envelope.drive.start_s, duration_s)
            for magnitude, duration_s in product(lattice.magnitudes, lattice.durations_s)
        ]
        records = bench.run(cells)
    states = [
        judge_cell(record, duration_s, envelope.drive, observe_s).state
        for record, (_, duration_s) in zip(
            records, product(lattice.magnitudes, lattice.durations_s), strict=True
        )
    ]
    count = len(lattice.durations_s)
    return [states[begin : begin + count] for begin in range(0, len(states), count)]


def show(envelope: mutator.Envelope, truth: list[list[CellState]]) -> bool:
    """Print how an envelope differs from the whole lattice; return whether it reaches the goals."""
    lines, durations = len(truth), len(truth[0])
    wrong, far, wrong_inferred, unknown = 0, 0, 0, 0
    for i, j in product(range(lines), range(durations)):
        state, actual = envelope.cells[i][j], truth[i][j]
        if actual is CellState.NOT_DECIDED:
            continue
        if not (state.is_hazardous or state.is_without_hazard):
            unknown += 1
            continue
        if state.is_hazardous is actual.is_hazardous:
            continue
        wrong += 1
        wrong_inferred += state is CellState.INFERRED
        beside = product(range(max(i - 1, 0), min(i + 2, lines)), range(max(j - 1, 0), min(j + 2, durations)))
        far += all(truth[a][b].is_hazardous is actual.is_hazardous for a, b in beside)
    driven = set(envelope.exploration.map.results)
    drawn = {cell for validation in envelope.exploration.validations for cell in validation.drawn}
    search = len(driven - drawn)
    factor = lines * durations / len(driven)
    failures = [len(envelope.exploration.failures(v)) for v in envelope.exploration.validations]
    print(
        f"{envelope.plane.spec} in {envelope.plane.scenario}: {search} runs of the search, {len(drawn)} of "
        f"validations ({failures} hazardous), {lines * durations} cells / runs = {factor:.1f}; of the cells "
        f"{wrong} wrong, {far} of them far, {wrong_inferred} inferred; {unknown} unknown; "
        f"{len(envelope.islands())} islands",
        flush=True,
    )
    islands = islands_of(truth)
    missed = sum(not any(envelope.cells[i][j].is_hazardous for i, j in island) for island in islands)
    print(f"  {len(islands)} islands of {LEAST_ISLAND} cells or more in truth, {missed} missed", flush=True)
    return far == 0 and wrong_inferred == 0 and missed == 0 and search <= GOALS["search"]


def islands_of(truth: list[list[CellState]]) -> list[set[Cell]]:
    """Return the groups of hazardous cells that touch each other, but the largest."""
    rest = {(i, j) for i, line in enumerate(truth) for j, state in enumerate(line) if state.is_hazardous}
    groups: list[set[Cell]] = []
    while rest:
        group, edge = set(), [rest.pop()]
        while edge:
            i, j = cell = edge.pop()
            group.add(cell)
            beside = {(a, b) for a, b in product(range(i - 1, i + 2), range(j - 1, j + 2))} & rest
            rest -= beside
            edge += beside
        groups.append(group)
    return [group for group in sorted(groups, key=len)[:-1] if len(group) >= LEAST_ISLAND]


if __name__ == "__main__":
    raise SystemExit(main())
