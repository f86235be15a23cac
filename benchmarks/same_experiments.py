"""Drive a run's experiments again with more changes of the setting: `python benchmarks/same_experiments.py`.

Ids name the setting, so that a campaign with another setting draws another sample. This takes the sample of
a run, and adds changes such as `coded_threshold_2_75` or `reference_plant` to the setting of each experiment.
The result is an ordinary run folder; the same command resumes it.
"""

import argparse
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import mutator
from mutator.campaigns.row_filters import matching_items
from mutator.model import Experiment
from mutator.results.plan_columns import plan_column_names, plan_row


class _ProofLeftOutError(Exception):
    """Ends a bench without its equivalence check."""


def change_experiments(
    experiments: Iterable[Experiment], changes: Sequence[str], only: str
) -> list[Experiment]:
    """Return the experiments that match `only` ("": all), with the changes added to their setting."""
    kept = matching_items(experiments, only, plan_column_names(), plan_row) if only else experiments
    return [replace(experiment, setting=(*experiment.setting, *changes)) for experiment in kept]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0] + ".")
    parser.add_argument("run", type=Path, metavar="RUN", help="a run folder of a campaign")
    parser.add_argument("out", type=Path, metavar="OUT", help="the new run folder")
    parser.add_argument("changes", nargs="+", metavar="CHANGE", help="a change that the manifest names")
    parser.add_argument("--only", default="", metavar="EXPR", help="only experiments that match")
    parser.add_argument("-n", "--workers", type=int, default=1)
    parser.add_argument("--no-proof", action="store_true", help="leave out the equivalence check")
    options = parser.parse_args()
    plan = mutator.load_run(options.run).plan
    experiments = change_experiments(plan.experiments, options.changes, options.only)
    campaign = options.run / "campaign.yaml"
    with (
        suppress(_ProofLeftOutError),
        mutator.open_bench(
            None, options.out, campaign=campaign, reading=plan.reading, workers=options.workers
        ) as bench,
    ):
        bench.run(experiments, f"experiments of {options.run.name} with {', '.join(options.changes)}")
        if options.no_proof:
            raise _ProofLeftOutError
    print(f"{mutator.load_run(options.out)!r}")


if __name__ == "__main__":
    main()
