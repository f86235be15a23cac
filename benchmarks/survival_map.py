"""Drive the campaign `map` fault by fault: what the controller survives, how large and how long.

`python benchmarks/survival_map.py OUT [--only PATTERN] [--workers N]`. Each fault has a run folder below OUT,
with all starts and scenarios of the campaign, so a map can be stopped after any fault. The same command goes
on where it was stopped, and prints the rows of faults that are finished.
"""

import argparse
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator.api.exploring_campaigns import planned_exploration
from mutator.campaigns.exploration_section import ExploredPlane
from mutator.store.plan_choices import Choices

CAMPAIGN = "map"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", default="*", help="only faults with such names")
    parser.add_argument("--workers", type=int, default=usable_cores())
    options = parser.parse_args()
    for explored in explored_faults(options.out, options.only, options.workers):
        print(describe(explored), flush=True)
    return 0


def explored_faults(out: Path, pattern: str = "*", workers: int = 1) -> Iterator[mutator.Envelopes]:
    """Yield the envelopes of each fault, driven now or before."""
    planned = planned_exploration(mutator.Workspace.find(), CAMPAIGN, Choices())
    section, seed = planned.section, planned.campaign.seed
    planes: dict[str, list[ExploredPlane]] = {}
    for plane in section.planes:
        planes.setdefault(plane.spec, []).append(plane)
    for spec, of_spec in planes.items():
        if fnmatch(spec, pattern):
            yield mutator.envelope(
                spec,
                list(dict.fromkeys(plane.scenario for plane in of_spec)),
                list(dict.fromkeys(float(plane.start) for plane in of_spec)),
                out / spec.replace("/", "-"),
                points=len(of_spec[0].durations_s),
                validation=section.validation,
                observe_s=section.observe_s,
                challengers=(),
                campaign=CAMPAIGN,
                seed=seed,
                workers=workers,
            )


def describe(explored: mutator.Envelopes) -> str:
    """Return how many planes and runs a fault has, and what the validations found."""
    planes = [each for each in explored if each.was_active]
    clean = [each for each in planes if not _failed_draws(each)]
    draws = sum(len(validation.drawn) for each in planes for validation in each.exploration.validations)
    runs = sum(each.run_count for each in explored)
    cells = sum(each.exploration.map.lattice.size for each in explored)
    name = explored[0].plane.spec if explored else explored.run.name
    return (
        f"{name}: {len(explored)} planes, {len(planes)} with the fault active; {runs:,} runs for {cells:,} "
        f"cells; {draws} draws, none hazardous in {len(clean)} planes"
        f"{f'; {explored.note}' if explored.note else ''}"
    )


def _failed_draws(envelope: mutator.Envelope) -> int:
    first = envelope.exploration.validations[:1]
    return sum(len(envelope.exploration.failures(validation)) for validation in first)


if __name__ == "__main__":
    raise SystemExit(main())
