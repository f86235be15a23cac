"""Differences between the inputs of two runs: sources, choices and versions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from mutator._common.hashing import as_json_types
from mutator._common.message_text import list_seeds
from mutator.comparison.compared_runs import ComparedRun
from mutator.comparison.experiment_matching import ExperimentMatching, ExperimentPair
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import describe_environments as ran_with
from mutator.store.session_environments import version_texts_by_package

_SHOWN_DIGEST_DIGITS = 12  # shown digits of a digest
_COMPARED_HEAD_FIELDS = ("campaign", "target", "seed", "reading")
_SELECTING_CHOICES = ("limit", "shard", "only", "exclude")  # choices that select some of the experiments


@dataclass(frozen=True, slots=True, kw_only=True)
class InputFact:
    """A named value of both runs."""

    name: str
    a: str
    b: str

    @property
    def is_different(self) -> bool:
        return self.a != self.b


@dataclass(frozen=True, slots=True, kw_only=True)
class DifferingTargetFiles:
    """Target files that differ between the runs, by path."""

    changed: tuple[str, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]


def input_facts(a: ComparedRun, b: ComparedRun) -> tuple[InputFact, ...]:
    """Everything that the runs' results depend on, with packages last."""
    heads = [_facts_of_run(side) for side in (a, b)]
    names = dict.fromkeys(name for head in heads for name in head)
    return tuple(InputFact(name=n, a=heads[0].get(n, "-"), b=heads[1].get(n, "-")) for n in names)


def _facts_of_run(run: ComparedRun) -> dict[str, str]:
    head, stretches = run.folder.head, run.folder.session_environments
    values = {name: str(getattr(head, name)) for name in _COMPARED_HEAD_FIELDS}
    if run.folder.is_bench:
        values["seed"] = list_seeds(e.seed for e in run.experiments)
    elif len(seeds := run.folder.seeds) > 1:
        values["seed"] = f"{seeds[0]} to {seeds[-1]}"
    values["setting"] = ", ".join(dict.fromkeys(c for e in run.experiments for c in e.setting)) or "-"
    values["chosen"] = (
        ", ".join(f"{k} {v}" for k, v in as_json_types(head.choices).items() if v is not None) or "-"
    )
    values |= {f"digest of {name}": value[:_SHOWN_DIGEST_DIGITS] for name, value in head.sources.items()}
    if scale := run.folder.severity_scale:
        bounds = ", ".join(f"{name} from {least:.3g} m/s" for name, least, _ in scale.classes[1:])
        values["scale of severity"] = f"{scale.name}: {bounds}"
    values["digest of plan"] = head.plan[:_SHOWN_DIGEST_DIGITS]
    values["mutator"] = head.provenance.mutator
    return (
        values
        | ran_with(stretches)
        | {f"package {k}": v for k, v in version_texts_by_package(stretches).items()}
    )


def differing_target_files(a: RunFolder, b: RunFolder) -> DifferingTargetFiles:
    """Return the target's files that differ."""
    of_a, of_b = a.head.target_files, b.head.target_files
    return DifferingTargetFiles(
        changed=tuple(sorted(path for path in of_a if path in of_b and of_a[path] != of_b[path])),
        only_a=tuple(sorted(set(of_a) - set(of_b))),
        only_b=tuple(sorted(set(of_b) - set(of_a))),
    )


def differing_pairs_remarks(a: ComparedRun, b: ComparedRun, matching: ExperimentMatching) -> tuple[str, ...]:
    """Return remarks on the number of pairs that differ in each input."""
    checks: tuple[tuple[str, Callable[[ExperimentPair], bool]], ...] = (
        ("with different injections", lambda p: p.a.fault.injections != p.b.fault.injections),
        ("with different trigger conditions", lambda p: p.a.trigger.condition != p.b.trigger.condition),
        ("with different holds or trigger times", lambda p: _hold_and_arming(p.a) != _hold_and_arming(p.b)),
        ("with different scenario files", lambda p: p.a.scenario_digest != p.b.scenario_digest),
        ("with different seeds", lambda p: p.a.seed != p.b.seed),
        (
            "that end at a terminal hazard in only one run, where later hazards and alerts are missing",
            lambda p: p.a.after_hazard != p.b.after_hazard,
        ),
        ("whose runs end at different times", lambda p: p.a.end_s != p.b.end_s),
    )
    counts = ((_count_differing(matching.pairs, differs), what) for what, differs in checks)
    return tuple(f"Pairs {what}: {n} of {len(matching.pairs)}." for n, what in counts if n)


def different_campaigns_remark(a: ComparedRun, b: ComparedRun) -> str:
    """Return a remark that the runs are of different campaigns, or of two versions of one; else ''."""
    head_a, head_b = a.folder.head, b.folder.head
    if head_a.campaign != head_b.campaign:
        campaigns = f"The runs are of different campaigns: {head_a.campaign} and {head_b.campaign}."
    elif head_a.campaign_digest != head_b.campaign_digest:
        campaigns = f"The file of the campaign {head_a.campaign} differs between the runs."
    else:
        return ""
    return f"{campaigns} Only experiments that both plan are compared."


def campaign_parts_remark(a: ComparedRun, b: ComparedRun) -> str:
    """Return a remark that the runs are different parts of a campaign; empty if they are the same part."""
    of_a, of_b = (
        {
            name: value
            for name in _SELECTING_CHOICES
            if (value := getattr(side.folder.head.choices, name)) is not None
        }
        for side in (a, b)
    )
    if of_a == of_b:
        return ""
    choices = [
        f"{side.name} has {', '.join(f'--{name} {value}' for name, value in chosen.items()) or 'everything'}"
        for side, chosen in ((a, of_a), (b, of_b))
    ]
    return (
        f"The runs are different parts of a campaign: {', '.join(choices)}. Only their overlap is compared."
    )


def severity_remarks(a: ComparedRun, b: ComparedRun) -> tuple[str, ...]:
    scales = [side.folder.severity_scale for side in (a, b)]
    if None in scales:
        (unclassified,) = [s for s, scale in zip((a, b), scales, strict=True) if not scale][:1]
        return (
            (f"Severity is not compared: {unclassified.name} has no severity classes.",)
            if any(scales)
            else ()
        )
    if scales[0] == scales[1]:
        return ()
    return (f"The runs have different severity scales; only that of {b.name} is used.",)


def _hold_and_arming(experiment: Any) -> tuple[object, ...]:
    trigger, fault = experiment.trigger, experiment.fault
    return (fault.hold or trigger.hold, trigger.hold_s, trigger.armed_after_s)


def _count_differing(pairs: Iterable[ExperimentPair], differs: Callable[[ExperimentPair], bool]) -> int:
    return sum(map(differs, pairs))
