"""How often intervals from samples contain the rate of the whole campaign.

    python benchmarks/sampling.py RUN            # a finished run of a whole campaign, such as `paper`
    python benchmarks/sampling.py --made-up 1    # made-up results of the campaign `paper`

Draws proportional and even samples from the records of a campaign, each with another seed, and drives
nothing. Of each sample, it estimates the rate of hazards of activated faults in each cell, fault type x
method, as reports do, and looks whether the 95 % interval contains the rate in all records. Cells with fewer
than 30 drawn experiments are left out.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mutator._common.hashing import digest
from mutator.campaigns.plan import build_plan
from mutator.campaigns.sampling import draw_balanced_pairs, draw_in_proportion
from mutator.model import Experiment, Fault
from mutator.statistics.results_frame import load_usable_results
from mutator.statistics.sample_weights import WEIGHT_COLUMN, with_weights_of_strata
from mutator.statistics.weighted_shares import share_of_runs
from mutator.store import plan_file
from mutator.store.plan_strata import PlanStrata, SampleDraw
from mutator.workspace import Workspace

LEAST_DRAWN = 30  # experiments in a cell
DRAWS = {SampleDraw.PROPORTIONAL: draw_in_proportion, SampleDraw.EVEN: draw_balanced_pairs}


def covered_cells(
    frame: pd.DataFrame, experiments: Sequence[Experiment], draw: SampleDraw, count: int, seed: int
) -> Counter[bool]:
    """Draw a sample; count the cells whose interval contains the rate of all records, and the others."""
    faults: Mapping[str, Fault] = {e.fault.id: e.fault for e in experiments}
    chosen = {e.id for e in DRAWS[draw](experiments, count, seed)}
    drawn = frame[frame["experiment_id"].isin(chosen)].reset_index(drop=True)
    drawn = with_weights_of_strata(drawn, PlanStrata.of_experiments(draw, experiments), faults)
    cells: Counter[bool] = Counter()
    for (kind, method), rows in drawn.groupby(["kind", "method"]):
        if len(rows) < LEAST_DRAWN or not rows["is_activated"].any():
            continue
        of_cell = frame[(frame["kind"] == kind) & (frame["method"] == method) & frame["is_activated"]]
        share = share_of_runs(rows, rows["is_hazard"], rows["is_activated"])
        cells[share.low <= of_cell["is_hazard"].mean() <= share.high] += 1
    return cells


def made_up_results(experiments: Sequence[Experiment], seed: int) -> pd.DataFrame:
    """Return results in which runs of a variant, and of a fault, are alike."""
    rng = np.random.default_rng(seed)
    names = {e.fault.spec for e in experiments}
    level = {name: rng.choice([0.0, 0.02, 0.1, 0.3, 0.6, 0.95]) for name in sorted(names)}
    of_fault = {name: rng.normal(0.0, 0.25) for name in dict.fromkeys(e.fault.id for e in experiments)}
    of_place = {
        place: rng.normal(0.0, 0.1)
        for place in sorted({(e.scenario, e.trigger.name[-2:]) for e in experiments})
    }
    rows = []
    for e in experiments:
        likely = level[e.fault.spec] + of_fault[e.fault.id] + of_place[e.scenario, e.trigger.name[-2:]]
        is_active = int(digest([e.scenario, e.trigger.name, e.fault.module])[:4], 16) % 10 < 8
        rows.append(
            {
                "experiment_id": e.id,
                "fault_id": e.fault.id,
                "kind": f"{e.fault.module}/{e.fault.fault_type}",
                "scenario": e.scenario,
                "method": e.method.value,
                "is_activated": is_active,
                "is_hazard": is_active and level[e.fault.spec] > 0 and rng.random() < likely,
            }
        )
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--made-up", type=int, metavar="SEED")
    parser.add_argument("--samples", type=int, default=10)
    parser.add_argument("--size", type=int, default=None, help="experiments in a sample; default: a tenth")
    options = parser.parse_args()
    if options.run:
        experiments: Sequence[Experiment] = plan_file.load_experiments(options.run)
        frame = load_usable_results(options.run / "results.csv")
        if WEIGHT_COLUMN in frame:
            parser.error(f"{options.run} is itself a sample; give a run of a whole campaign")
    else:
        experiments = build_plan(Workspace.find(), "paper").experiments
        frame = made_up_results(experiments, options.made_up or 1)
    size = options.size or len(experiments) // 20 * 2
    for draw in DRAWS:
        total: Counter[bool] = Counter()
        for seed in range(1, options.samples + 1):
            total += covered_cells(frame, experiments, draw, size, seed)
        cells = sum(total.values())
        print(
            f"{draw.value}: {options.samples} samples of {size:,}: {total[True]} of {cells} intervals "
            f"({100 * total[True] / cells:.1f} %) contain the rate of all {len(frame):,} records"
        )


if __name__ == "__main__":
    main()
