"""Compare runs of the paper's campaigns with the paper: `python benchmarks/agreement.py RUN...`.

Prints guided hazards of activated faults by fault type, in each run and in the paper, and Spearman's rank
correlation with its 95 % interval from a bootstrap over fault types.
"""

import argparse
from pathlib import Path

from mutator.paper.fault_type_rank_agreement import GUIDED, measure_agreement
from mutator.paper.published_numbers import load_published_numbers
from mutator.results.table_reader import Results
from mutator.statistics.results_frame import prepare_results
from mutator.statistics.tallies import Tally, tally_by_fault_type

REFERENCES = Path(__file__).resolve().parents[1] / "fault_library/references"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a run folder")
    options = parser.parse_args()
    published = load_published_numbers(REFERENCES)
    frames = [prepare_results(Results.up_to_date(run).frame()) for run in options.runs]
    tallies = [tally_by_fault_type(frame) for frame in frames]
    width = max(12, *(len(run.name) for run in options.runs))
    print(
        f"{'hazards of activated':34}",
        *(f"{name:>{width}}" for name in ("paper", *(r.name for r in options.runs))),
    )
    for key, tally in published.tally_by_fault_type.items():
        if key[0] == GUIDED:
            cells = [_share(tally), *(_share(ours.get(key)) for ours in tallies)]
            print(f"{key[1]:34}", *(f"{cell:>{width}}" for cell in cells))
    for run, frame in zip(options.runs, frames, strict=True):
        found = measure_agreement(frame, published)
        print(
            f"{run.name}: rank correlation {found.correlation:.2f}, {found.low:.2f} to {found.high:.2f}, "
            f"{found.fault_types} fault types, tied: {found.tied_here} here, {found.tied_there} in the paper"
        )


def _share(tally: Tally | None) -> str:
    return f"{tally.hazards} of {tally.activated}" if tally else "-"


if __name__ == "__main__":
    main()
