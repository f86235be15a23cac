"""Messages to and from a fork that becomes a mutant: the request, and the check of its report."""

from types import CodeType
from typing import Any

from mutator.engines.code_swap_planning import CodeSwap, FunctionSwap
from mutator.engines.engine_jobs import Job
from mutator.engines.first_activation import ForkPoint
from mutator.engines.job_folder import JobFolder
from mutator.engines.thread_messages import describe_too_many_threads, remedy_for_threads
from mutator.errors import NotForkable
from mutator.limits import Limits
from mutator.mutants.defence_runtime import defence_report_request
from mutator.mutants.probe_contract import probe_attributes_after, probe_module
from mutator.targets.manifest import TargetManifest


class SharedParts:
    """The parts of requests that most mutants have, because the null mutant has them, too.

    The server gets them once (`as_message`); a request has their numbers. Otherwise each fork would unmarshal
    them, and so copy the memory of all names in them.
    """

    def __init__(self, null_mutant: CodeSwap | None) -> None:
        self._parts: list[CodeType | FunctionSwap] = (
            [null_mutant.probe_code[1], *null_mutant.functions] if null_mutant else []
        )

    def as_message(self) -> list[Any]:
        return list(map(_part_as_message, self._parts))

    def part_or_number(self, part: CodeType | FunctionSwap) -> Any:
        """Return a part of a request, or the number of the same object here: compiling caches its results."""
        numbers = (number for number, shared in enumerate(self._parts) if shared is part)
        return next(numbers, _part_as_message(part))


def _part_as_message(part: CodeType | FunctionSwap) -> Any:
    if isinstance(part, CodeType):
        return part
    return part.module, part.name_path, part.old_code, part.new_code


def fork_request(
    manifest: TargetManifest,
    limits: Limits,
    home: JobFolder,
    swap: CodeSwap,
    shared: SharedParts,
    fork_point: ForkPoint,
    *,
    stop_source: str | None,
    observe: bool,
) -> dict[str, Any]:
    """Return what a fork needs to run the mutant. Without `args`, it continues a run that has begun."""
    return {
        "home": str(home.path),
        "out": str(home.output_folder),
        "child_activations": str(home.child_activations_path),
        "args": None,
        "defences": defence_report_request(manifest),
        "cpu_s": limits.cpu_s,
        "memory_mb": limits.memory_mb,
        "disk_mb": limits.disk_mb,
        "steps": limits.steps,
        "probe_name": probe_module(manifest.probe_package),
        "probe": list(map(shared.part_or_number, swap.probe_code)),
        "functions": list(map(shared.part_or_number, swap.functions)),
        "settings": swap.probe_value_setters,
        "probe_state": probe_attributes_after(
            fork_point.observation_count, fork_point.earliest_time_s, fork_point.last_time_s
        ),
        "stop": stop_source,
        "watch": [value.name for value in manifest.observation.values] if observe else None,
    }


def check_fork_report(job: Job, report: dict[str, Any], *, is_golden: bool) -> None:
    """Raise NotForkable if the child did not run the mutant's code, or if threads of a golden run are left.

    A mutant has started its threads itself after the fork, as it would in a fresh interpreter. A golden run
    that starts threads could not be forked after that.
    """
    if report["ended"] == "swap refused":
        raise NotForkable(str(report.get("why")))
    if report["outside"]:
        raise NotForkable(f"the target was also imported from {', '.join(report['outside'])}")
    if is_golden and report["threads"]:
        others = report["threads"]
        raise NotForkable(f"at its end {describe_too_many_threads(others)}", remedy_for_threads(others))
    if report["ended"] == "ok" and (problem := job.problem_of_probe_report(report["probe"])):
        raise NotForkable(problem)
