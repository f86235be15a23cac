"""Measure how many mutants a second are built.

`python benchmarks/mutants.py [--sample N] [--rounds N] [--json FILE]`. There are three ways to build a
mutant: from reused changes, by splicing, and by splicing after LibCST has parsed each file again. First, the
benchmark builds the mutant of every experiment of the paper's campaign, including diff, compile check and
digests. Then the three ways build the same sample alternately, in rounds. The mutants of operators, each at a
different place, are found in the shipped controller, whose files are parsed beforehand. Times are CPU times
of this process.
"""

import argparse
import json
import random
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.campaigns.plan import build_plan
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment
from mutator.mutants.mutant_building import build, build_without_reusing_changed_files
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.operators.mutation_selection import sample_mutations, select_mutations
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
GOAL = 500.0  # mutants a second on one core
PLACES = ["selfdrive/controls/**"]


def rate(make: Callable[[Experiment], object], experiments: list[Experiment]) -> float:
    start = process_time()
    for experiment in experiments:
        make(experiment)
    return len(experiments) / (process_time() - start)


def operators(manifest: TargetManifest, models: FaultModels, count: int) -> tuple[float, float]:
    """Return how many mutants of operators are found and how many are built per second of CPU."""
    select_mutations(manifest, models, ["return"], PLACES)  # parses the files, as every campaign must
    start = process_time()
    found = select_mutations(manifest, models, OPERATOR_DOOR.names(), PLACES)
    took = process_time() - start
    faults = [mutation.to_fault("as_described") for mutation in sample_mutations(found, count, 1)]
    trigger = always_trigger()
    build(manifest, models, faults[0], trigger)  # parses the file that observes
    start = process_time()
    for fault in faults:
        build(manifest, models, fault, trigger)
    return len(found.mutations) / took, len(faults) / (process_time() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    workspace = Workspace.find(root=ROOT)
    plan = build_plan(workspace, "paper")
    manifest, models = workspace.manifest(plan.campaign.target), workspace.fault_models()

    def reused(experiment: Experiment) -> None:
        build(manifest, models, experiment.fault, experiment.trigger)

    def spliced(experiment: Experiment) -> None:
        build_without_reusing_changed_files(manifest, models, experiment.fault, experiment.trigger)

    def parsed(experiment: Experiment) -> None:
        changed = {manifest.observation.location, *(i.location for i in experiment.fault.injections)}
        for path in {location.path for location in changed}:
            parse_file(path, manifest.tree.files[path], manifest.root)
        spliced(experiment)

    found, made = operators(manifest, models, options.sample * 5)
    whole = rate(reused, list(plan.experiments))
    print(f"the paper's {len(plan.experiments)}: {whole:.0f} a second (goal {GOAL:.0f})")
    print(f"mutants of operators: {found:.0f} found and {made:.0f} built a second (goal {GOAL:.0f})")
    sample = random.Random(1).sample(plan.experiments, options.sample)
    ways = {"reused": reused, "spliced": spliced, "spliced, parsed": parsed}
    rates: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(options.rounds):
        for name, make in ways.items():
            rates[name].append(rate(make, sample[: 20 if make is parsed else None]))
    for name, values in rates.items():
        ratios = [reuse / value for reuse, value in zip(rates["reused"], values, strict=True)]
        print(f"  {name:16}{median(values):8.1f} a second; reuse builds {median(ratios):7.2f} times as many")
    if options.json:
        figures = {"unit": "1/s of CPU", "campaign": whole, "operators": made, "rates": rates}
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    sys.exit(1 if min(whole, made) < GOAL else 0)


if __name__ == "__main__":
    main()
