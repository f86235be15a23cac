"""Drive the campaign `map` fault by fault: what the controller survives, how large and how long.

`python benchmarks/survival_map.py OUT [--only PATTERN] [--workers N] [--table FILE]`. Each fault has a run
folder below OUT, with all starts and scenarios of the campaign, so a map can be stopped after any fault. The
same command goes on where it was stopped. It prints what was driven; `--table` writes a row for each fault
and sign, as Markdown: what is survived from every start on in every scenario, and where most is not.
"""

import argparse
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator._common.table_rendering import TextTable
from mutator.api.exploring_campaigns import ExploringCampaign, planned_exploration
from mutator.explore.challenges import TABLE_DURATIONS_S
from mutator.explore.envelope_failures import first_failure, hazardous_share
from mutator.explore.envelope_texts import fault_text, magnitude_text, start_text
from mutator.store.plan_choices import Choices

CAMPAIGN = "map"
HEADS = (
    "fault",
    "survived for every duration",
    *(f"for {duration:g} s" for duration in TABLE_DURATIONS_S),
    "largest tried",
    "survived for",
    "hazard after",
    "worst plane, hazardous cells",
    "runs of cells",
    "hazardous of draws",
)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", default="*", help="only faults with such names")
    parser.add_argument("--workers", type=int, default=usable_cores())
    parser.add_argument("--table", type=Path, metavar="FILE")
    options = parser.parse_args()
    planned = planned_exploration(mutator.Workspace.find(), CAMPAIGN, Choices())
    specs = dict.fromkeys(plane.spec for plane in planned.section.planes)
    rows = []
    for spec in (spec for spec in specs if fnmatch(spec, options.only)):
        explored = explore_fault(planned, spec, options.out, options.workers)
        print(describe(spec, explored), flush=True)
        by_fault: dict[str, list[mutator.Envelope]] = {}
        for envelope in explored:
            by_fault.setdefault(fault_text(envelope), []).append(envelope)
        rows += [row_of_fault(name, envelopes) for name, envelopes in by_fault.items()]
        if options.table:
            options.table.write_text(TextTable(heads=HEADS, rows=rows).as_markdown() + "\n")
    return 0


def explore_fault(planned: ExploringCampaign, spec: str, out: Path, workers: int) -> mutator.Envelopes:
    """Return the envelopes of a fault, driven now or before."""
    section = planned.section
    planes = [plane for plane in section.planes if plane.spec == spec]
    return mutator.envelope(
        spec,
        list(dict.fromkeys(plane.scenario for plane in planes)),
        list(dict.fromkeys(float(plane.start) for plane in planes)),
        out / spec.replace("/", "-"),
        points=len(planes[0].durations_s),
        validation=section.validation,
        observe_s=section.observe_s,
        challengers=(),
        campaign=CAMPAIGN,
        seed=planned.campaign.seed,
        workers=workers,
    )


def describe(spec: str, explored: mutator.Envelopes) -> str:
    """Return how many planes and runs a fault has, and in how many planes with draws none was hazardous."""
    active = sum(envelope.was_active for envelope in explored)
    draws = [draw for draw in map(_draws, explored) if any(draw)]
    clean = sum(not hazardous and not earlier for _, hazardous, earlier in draws)
    return (
        f"{spec}: {len(explored)} planes, {active} with the fault active; "
        f"{sum(envelope.run_count for envelope in explored):,} runs; "
        f"{clean} of {len(draws)} planes with draws had no hazardous one"
        f"{f'; {explored.note}' if explored.note else ''}"
    )


def row_of_fault(name: str, envelopes: Sequence[mutator.Envelope]) -> list[str]:
    """Return what all planes of a fault and a sign survive, and the worst of them."""
    active = [envelope for envelope in envelopes if envelope.was_active]
    runs = sum(envelope.run_count for envelope in envelopes)
    cells = sum(envelope.exploration.map.lattice.size for envelope in envelopes)
    if not active:
        return [name, *["never active"] * (len(HEADS) - 3), f"{runs:,} of {cells:,}", "-"]
    worst = max(active, key=hazardous_share)
    last = len(worst.magnitudes) - 1
    longest = [envelope.longest_survived_s(last) for envelope in active]
    times = [time for envelope in active if (time := envelope.time_to_hazard_s(last)) is not None]
    draws = list(map(_draws, active))
    plane = f"{worst.plane.scenario} from {start_text(worst)}, {hazardous_share(worst):.0%}"
    return [
        name,
        *(_survived_text(active, duration) for duration in (None, *TABLE_DURATIONS_S)),
        magnitude_text(worst, worst.magnitudes[last]) if worst.plane.magnitudes else "-",
        "none" if None in longest else f"{min(each for each in longest if each is not None):g} s",
        f"{min(times):.2f} s" if times else "-",
        plane if any(map(first_failure, active)) else "none",
        f"{runs:,} of {cells:,}",
        f"{sum(h for _, h, _ in draws)} of {sum(d for d, _, _ in draws)}",
    ]


def _survived_text(envelopes: Sequence[mutator.Envelope], duration_s: float | None) -> str:
    """Return the largest magnitude that all planes survive; `yes` or `no` for a fault without one."""
    if not envelopes[0].plane.magnitudes:
        counts = [envelope.columns_up_to(duration_s) for envelope in envelopes]
        states = (s for e, count in zip(envelopes, counts, strict=True) for s in e.cells[0][:count])
        return "yes" if all(state.is_without_hazard for state in states) else "no"
    sizes = [envelope.largest_survived(duration_s) for envelope in envelopes]
    smallest = min((size for size in sizes if size is not None), key=abs, default=None)
    return "none" if None in sizes else magnitude_text(envelopes[0], smallest)


def _draws(envelope: mutator.Envelope) -> tuple[int, int, int]:
    """Return how many cells the last validation drew, how many were hazardous, and how many before."""
    looks = envelope.exploration.validations
    failed = [len(envelope.exploration.failures(look)) for look in looks]
    return (len(looks[-1].drawn), failed[-1], sum(failed[:-1])) if looks else (0, 0, 0)


if __name__ == "__main__":
    raise SystemExit(main())
