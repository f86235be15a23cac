"""Shrink every hazard of finished runs, and check each result with runs of its own.

`python benchmarks/shrinks.py RUN... [--most N]`. A result is right if the reference engine, which drives it
and its next smaller neighbours once more, gives the hazard for it, and not for a neighbour.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import median

import mutator

MOST_RUNS, MOST_RUNS_WITH_ENVELOPE = 35, 3


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--most", type=int, default=16, help="hazards of each run, spread over all")
    options = parser.parse_args()
    runs, wrong = list[int](), 0
    for path in options.runs:
        run = mutator.load_run(path)
        hazardous = [name for name, record in run.records.items() if record.hazards]
        step = max(1, len(hazardous) / options.most)
        for name in [hazardous[int(i * step)] for i in range(min(options.most, len(hazardous)))]:
            with tempfile.TemporaryDirectory() as folder:
                smallest = run.experiment(name).shrink(Path(folder) / "shrunk", workers=2)
                is_right = check(smallest, Path(folder) / "checked")
            runs.append(smallest.runs)
            wrong += not is_right
            label = f"{smallest.experiment.label}: {smallest.minimal}"
            print(f"{smallest.runs:3} runs, {'right' if is_right else 'WRONG'}: {label}", flush=True)
    most = MOST_RUNS_WITH_ENVELOPE if all(map(is_explored, options.runs)) else MOST_RUNS
    print(f"{len(runs)} results, {wrong} wrong; median {median(runs):g} runs (goal {most}), most {max(runs)}")
    return int(wrong > 0 or median(runs) > most)


def is_explored(path: Path) -> bool:
    return bool(mutator.load_run(path).envelopes)


def check(smallest: mutator.SmallestForm, out: Path) -> bool:
    """Drive the result and its neighbours on the reference engine; whether only the result has the hazard."""
    experiments = [smallest.experiment, *smallest.neighbours.values()]
    with mutator.open_bench(
        None,
        out,
        reading=smallest.original.fault.reading,
        after_hazard=smallest.original.after_hazard,
        engine="reference",
        reuse=False,
    ) as bench:
        results = bench.run(experiments)
    return [smallest.hazard in dict(record.hazards) for record in results] == [
        experiment is smallest.experiment for experiment in experiments
    ]


if __name__ == "__main__":
    raise SystemExit(main())
