"""Explore the worst plane of each fault of a map: with challengers, and in concrete scenarios.

`python benchmarks/worst_planes.py MAP OUT [--family acc_settings] [--scenarios 20] [--first N]`. MAP is a
folder of `survival_map.py`. The worst plane of a fault has the largest share of hazardous cells. It is
explored again in its scenario, with challengers, and from the same start on in scenarios drawn from a
family. Each fault has a run folder of both below OUT; the same command goes on where it was stopped. In
the family `acc_settings`, no drive without faults has a contact; a scenario whose golden run has a hazard
is not driven.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import mutator
from mutator.api.explorations import DEFAULT_CHALLENGERS
from mutator.explore.envelope_failures import hazardous_share
from mutator.families.family import argument_of
from mutator.families.scenario_sampling import sample_scenarios

SEED = 1


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("map", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--family", default="acc_settings")
    parser.add_argument("--scenarios", type=int, default=20)
    parser.add_argument("--points", type=int, default=12)
    parser.add_argument("--first", type=int, help="only so many faults, the worst ones")
    options = parser.parse_args()
    family = mutator.Workspace.find().family(options.family)
    drawn = [argument_of(s) for s in sample_scenarios(family, options.scenarios, family.sampling, SEED)]
    explored_runs = [mutator.load_run(path.parent) for path in sorted(options.map.glob("*/envelopes.json"))]
    envelopes = [envelope for run in explored_runs for envelope in run.envelopes]
    for worst in worst_envelopes(envelopes)[: options.first]:
        plane = worst.plane
        name = plane.spec.replace("/", "-")
        for kind, scenarios, challengers in (
            ("challenged", [plane.scenario], DEFAULT_CHALLENGERS),
            ("drawn", drawn, ()),
        ):
            explored = mutator.envelope(
                plane.spec,
                scenarios,
                plane.start,
                options.out / f"{name}-{kind}",
                points=options.points,
                challengers=challengers,
                seed=SEED,
                campaign="map",
                workers=2,
            )
            shares = ", ".join(
                f"{hazardous_share(envelope):.0%}" if envelope.was_active else "not decided"
                for envelope in explored
            )
            lowered = sum(c.is_lowered for envelope in explored for c in envelope.challenges)
            print(
                f"{plane.spec} from {plane.start} on, {kind} ({len(explored)} planes, "
                f"{sum(envelope.run_count for envelope in explored)} runs): hazardous {shares}; "
                f"{lowered} bounds lowered{f'; {explored.note}' if explored.note else ''}",
                flush=True,
            )
    return 0


def worst_envelopes(envelopes: Sequence[mutator.Envelope]) -> list[mutator.Envelope]:
    """Return the worst envelope of each fault, the worst of all first."""
    worst: dict[str, mutator.Envelope] = {}
    for envelope in sorted(envelopes, key=hazardous_share, reverse=True):
        worst.setdefault(envelope.plane.spec, envelope)
    return list(worst.values())


if __name__ == "__main__":
    raise SystemExit(main())
