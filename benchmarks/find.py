"""Compare the strategies of `mutator search` on the shipped target, or on another library.

`python benchmarks/find.py [--budgets 100 300] [--seeds 1 2 3] [--held-out 5] [--root DIR --campaign
NAME]`. All faults that need no pictures, in S1 to S5 (or `--scenarios`), from two starts on (or
`--starts`). A finding is a hazard of a fault in a scenario from a start. The share of dominated cells,
summed over planes, says how small and short the found faults are. With `--held-out`, so many times a
third of the faults is left out, drawn at random: a strategy that fits these faults alone does worse
without some. `--root` is the folder of another library, such as `examples/highway --campaign first
--scenarios first --starts 5 10`.
"""

import argparse
import random
import tempfile
from pathlib import Path
from statistics import mean

import mutator
from mutator.api.explorations import search

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS, STARTS = ("S1", "S2", "S3", "S4", "S5"), (5.0, 12.0)
GOALS = {100: (2.5, 2.0), 300: (2.0, 2.5)}  # planes / random: findings, dominated cells


def specs(workspace: mutator.Workspace) -> list[str]:
    variants = ((spec.name, variant) for spec in workspace.specs() for variant in spec)
    return [f"{name}/{variant.name}" for name, variant in variants if "pictures" not in variant.changes]


def libraries(faults: list[str], held_out: int) -> list[list[str]]:
    """Return all faults, or `held_out` times two thirds of them."""
    if not held_out:
        return [faults]
    drawn = (set(random.Random(n).sample(faults, len(faults) // 3)) for n in range(held_out))
    return [[fault for fault in faults if fault not in left_out] for left_out in drawn]


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--budgets", type=int, nargs="+", default=[100, 300])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--held-out", type=int, default=0)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--campaign", default="quickstart")
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument("--starts", type=float, nargs="+", default=STARTS)
    return parser.parse_args()


def main() -> int:
    options, missed = parsed(), False
    workspace = mutator.Workspace.find(root=options.root, templates=ROOT / "templates")
    for budget in options.budgets:
        for number, faults in enumerate(libraries(specs(workspace), options.held_out), start=1):
            figures = {
                strategy: [measure(options, workspace, faults, budget, strategy, seed) for seed in seeds]
                # results decide what `planes` drives, not the seed
                for strategy, seeds in (("planes", options.seeds[:1]), ("random", options.seeds))
            }
            (findings, dominated), by_chance = figures["planes"][0], figures["random"]
            name = f"{budget} runs" + (f", faults {number} ({len(faults)})" if options.held_out else "")
            for strategy, values in figures.items():
                texts = ", ".join(f"{count} findings and {share:.2f} dominated" for count, share in values)
                print(f"{name}, {strategy}: {texts}", flush=True)
            # no finding by chance counts as one in all seeds together
            ratios = [
                by_results / (mean(values) or 1 / len(values))
                for by_results, values in zip(
                    (findings, dominated), zip(*by_chance, strict=True), strict=True
                )
            ]
            print(f"{name}, planes / random: {ratios[0]:.2f} findings, {ratios[1]:.2f} dominated", flush=True)
            goals = GOALS.get(budget, (0.0, 0.0))
            missed |= any(ratio < goal for ratio, goal in zip(ratios, goals, strict=True))
    return int(missed)


def measure(
    options: argparse.Namespace,
    workspace: mutator.Workspace,
    faults: list[str],
    budget: int,
    strategy: str,
    seed: int,
) -> tuple[int, float]:
    with tempfile.TemporaryDirectory() as folder:
        searched = search(
            faults,
            list(options.scenarios),
            list(options.starts),
            Path(folder) / "run",
            budget=budget,
            strategy=strategy,  # type: ignore[arg-type]
            seed=seed,
            campaign=options.campaign,
            workers=2,
            workspace=workspace,
        )
    return len(searched), searched.dominated


if __name__ == "__main__":
    raise SystemExit(main())
