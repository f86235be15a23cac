"""Compare the strategies of `mutator search` on the shipped target.

`python benchmarks/find.py [--budgets 100 300] [--seeds 1 2 3]`. All faults that need no pictures, in S1 to
S5, from two starts on. A finding is a hazard of a fault in a scenario from a start. The share of dominated
cells, summed over planes, says how small and short the found faults are.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import mean

import mutator
from mutator.api.explorations import search

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS, STARTS = ("S1", "S2", "S3", "S4", "S5"), (5, 12)
GOALS = {100: (2.5, 2.0), 300: (2.0, 2.5)}  # planes / random: findings, dominated cells


def specs() -> list[str]:
    workspace = mutator.Workspace.find(root=ROOT)
    variants = ((spec.name, variant) for spec in workspace.specs() for variant in spec)
    return [f"{name}/{variant.name}" for name, variant in variants if "pictures" not in variant.changes]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--budgets", type=int, nargs="+", default=[100, 300])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    options = parser.parse_args()
    missed = False
    with tempfile.TemporaryDirectory() as folder:
        for budget in options.budgets:
            figures = {
                strategy: [measure(Path(folder), budget, strategy, seed) for seed in seeds]
                # results decide what `planes` drives, not the seed
                for strategy, seeds in (("planes", options.seeds[:1]), ("random", options.seeds))
            }
            (findings, dominated), by_chance = figures["planes"][0], figures["random"]
            ratios = findings / mean(f for f, _ in by_chance), dominated / mean(d for _, d in by_chance)
            for strategy, values in figures.items():
                texts = ", ".join(f"{count} findings and {share:.2f} dominated" for count, share in values)
                print(f"{budget} runs, {strategy}: {texts}")
            print(f"{budget} runs, planes / random: {ratios[0]:.2f} findings, {ratios[1]:.2f} dominated")
            goals = GOALS.get(budget, (0.0, 0.0))
            missed |= any(ratio < goal for ratio, goal in zip(ratios, goals, strict=True))
    return int(missed)


def measure(folder: Path, budget: int, strategy: str, seed: int) -> tuple[int, float]:
    out = folder / f"{strategy}-{budget}-{seed}"
    searched = search(
        specs(),
        list(SCENARIOS),
        list(STARTS),
        out,
        budget=budget,
        strategy=strategy,  # type: ignore[arg-type]
        seed=seed,
        campaign="quickstart",
        workers=2,
    )
    return len(searched), searched.dominated


if __name__ == "__main__":
    raise SystemExit(main())
