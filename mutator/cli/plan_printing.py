"""Print a plan: experiments by fault type, drives by family, and what running it costs."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import mutator
from mutator._common.message_text import counted, describe_seeds
from mutator.cli.terminal_output import Terminal
from mutator.execution.progress_text import describe_duration

if TYPE_CHECKING:
    from mutator.campaigns.plan import PlanCost


def print_plan_as_json(
    terminal: Terminal,
    folder: Path,
    new_plan: "mutator.Plan",
    cost: "PlanCost",
    reason_by_variant: dict[str, str],
) -> None:
    kinds = [
        {"module": m, "fault_type": f, "method": method, "experiments": n}
        for (m, f, method), n in sorted(new_plan.groups().items())
    ]
    facts = {
        "run": str(folder),
        "digest": new_plan.digest,
        "seed": new_plan.seed,
        "reading": new_plan.reading,
    }
    facts |= {"seeds": [new_plan.seeds[0], new_plan.seeds[-1]]} if len(new_plan.seeds) > 1 else {}
    facts |= {"experiments": len(new_plan.experiments), "runs": new_plan.runs, "groups": kinds, "cost": cost}
    terminal.print_json(facts | {"not_forked": reason_by_variant})


def print_plan(
    terminal: Terminal, new_plan: "mutator.Plan", cost: "PlanCost", reason_by_variant: dict[str, str]
) -> None:
    _print_drives(terminal, new_plan)
    groups = sorted(new_plan.groups().items())
    has_methods = len({method for (_, _, method), _ in groups}) > 1
    rows = [
        (f"{module}/{kind}", *([method] if has_methods else []), n) for (module, kind, method), n in groups
    ]
    if not new_plan.campaign.is_fault_free:
        terminal.print_table(
            ["fault type", *(["method"] if has_methods else []), "experiments"],
            [*rows, ("total", *([""] if has_methods else []), len(new_plan.experiments))],
            right_aligned=(2 if has_methods else 1,),
            last_is_total=True,
        )
    for text in new_plan.operator_notes:
        terminal.print_text(text)
    if len(new_plan.seeds) > 1:
        terminal.print_text(
            f"{describe_seeds(new_plan.seeds)}: {len(new_plan.goldens())} golden runs (each seed has its own)"
        )
    if sharing := len(new_plan.experiments) - new_plan.runs:
        terminal.print_text(
            f"runs: {new_plan.runs}; experiments that reuse another scenario's identical run: {sharing}"
        )
    for reason, variants in _variants_by_reason(reason_by_variant).items():
        terminal.print_text(f"only the reference engine can run {', '.join(variants)}: {reason}")
    terminal.print_text(f"expected: {_describe_cost(cost)}")


def _print_drives(terminal: Terminal, new_plan: "mutator.Plan") -> None:
    """Print how many scenarios of each family there are; nothing without families."""
    drawn = Counter(concrete.family for concrete in new_plan.tally.concrete_by_name.values())
    if drawn or new_plan.drives:
        rows = [*drawn.items(), ("total", len(new_plan.goldens()))]
        terminal.print_table(
            ["family", "golden runs" if new_plan.experiments else "drives"],
            rows,
            right_aligned=(1,),
            last_is_total=True,
        )


def _variants_by_reason(reason_by_variant: dict[str, str]) -> dict[str, list[str]]:
    return {
        reason: [name for name in reason_by_variant if reason_by_variant[name] == reason]
        for reason in reason_by_variant.values()
    }


def _describe_cost(cost: "PlanCost") -> str:
    source = "measured in this folder" if cost.is_measured else "estimated with a default time per run"
    time, disk = describe_duration(cost.wall_s), cost.disk_bytes / 1e6
    workers = counted(cost.workers, "worker")
    limit = (
        "ten times the CPU time of the golden run, at least 10 s"
        if cost.cpu_limit_s is None
        else f"{describe_duration(cost.cpu_limit_s)} of CPU"
    )
    return (
        f"{time} with {workers} ({describe_duration(cost.cpu_s)} of CPU), {disk:.0f} MB of disk; {source}; "
        f"a run that hangs costs {limit}"
    )
