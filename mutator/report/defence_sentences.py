"""The sentences about sets of defences: what saves most of the worst, what it costs, and what sets cause."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

from mutator._common.message_text import counted
from mutator.comparison.defended_pairs import DefendedPair, PairOutcome
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.defended_sheets import prevented_share

_Facts = TypeVar("_Facts", bound=tuple[int, ...])


def describe_sets(sets: Sequence[DefendedSet], step_s: float | None) -> Iterable[str]:
    """Say first what saves most of the worst, then what it costs, then what defences caused. `step_s`: the
    length of a step in s; None if it is not known.
    """
    yield from _sentences_of_best(sets)
    for defended in sets:
        if defended.missing_count:
            missing = counted(defended.missing_count, "experiment")
            yield f"`{defended.name}` is not finished: {missing} without a result are left out."
        if defended.lost_count:
            lost_text = counted(defended.lost_count, "run")
            yield f"With `{defended.name}`, {lost_text} of experiments with a hazard cannot be compared."
        if defended.caused_goldens:
            runs = ", ".join(defended.caused_goldens)
            yield f"`{defended.name}` causes a hazard without any fault: in {runs}."
    yield _caused_sentence(sets)
    yield _latency_sentence(step_s)


def hazardous_pairs(defended: DefendedSet) -> list[DefendedPair]:
    """Return the pairs that can be compared and whose undefended run has a hazard."""
    return [
        pair
        for pair in defended.pairs
        if pair.undefended.hazards and pair.outcome is not PairOutcome.NOT_COMPARED
    ]


def _sentences_of_best(sets: Sequence[DefendedSet]) -> Iterable[str]:
    """Say which sets prevent the most of the worst, all that tie, and what they leave open and cost."""
    severity = max((pair.undefended.severity for d in sets for pair in hazardous_pairs(d)), default="")
    worst = {
        d.name: [pair for pair in hazardous_pairs(d) if pair.undefended.severity == severity] for d in sets
    }
    if not any(worst.values()):
        has_lost = any(defended.lost_count for defended in sets)
        yield (
            "No undefended run with a hazard has a result with defences."
            if has_lost
            else "No undefended run has a hazard, so there was nothing to prevent."
        )
        yield from _cost_sentences(sets)
        return
    what = f"the worst hazards (severity {severity})" if severity else "the hazards"
    of_worst = {name: _count_prevented(pairs) for name, pairs in worst.items()}
    of_all = {d.name: _count_prevented(hazardous_pairs(d)) for d in sets}
    counts = of_worst if any(of_worst.values()) else of_all
    most = max(counts.values())
    best = [d for d in sets if counts[d.name] == most]
    best.sort(key=lambda d: of_all[d.name], reverse=True)
    if not most:
        yield "No set prevents any hazard."
    elif counts is of_worst:
        sizes = [len(worst[d.name]) for d in best]
        yield _worst_sentence([d.name for d in best], sizes, most, what, is_only=len(sets) == 1)
        yield _shares_sentence(best, is_most=False)
    else:
        yield f"No set prevents any of {what}."
        yield _shares_sentence(best, is_most=len(sets) > 1)
    yield from _open_sentences(best)
    yield from _cost_sentences(best)


def _count_prevented(pairs: Iterable[DefendedPair]) -> int:
    return sum(pair.outcome is PairOutcome.PREVENTED for pair in pairs)


def _worst_sentence(
    names: Sequence[str], sizes: Sequence[int], most: int, what: str, *, is_only: bool
) -> str:
    """Say how many of the worst hazards the best sets prevent. `sizes` has the number of the worst in each
    set, because runs that cannot be compared are left out.
    """
    if all(2 * most > size for size in sizes):
        how_many = "All" if all(most == size for size in sizes) else "Most"
        by = " and by ".join(f"`{n}` ({most} of {size})" for n, size in zip(names, sizes, strict=True))
        return f"{how_many} of {what} are prevented by {by}."
    of = " or ".join(f"{most} of {size}" for size in dict.fromkeys(sizes))
    if is_only:
        return f"{_listed(names)} prevents {of} of {what}."
    if len(names) == 1:
        return f"{_listed(names)} prevents the most of {what}: {of}."
    return f"{_listed(names)} prevent the most of {what}: {of} each."


def _shares_sentence(best: Sequence[DefendedSet], *, is_most: bool) -> str:
    shares = {defended.name: prevented_share(defended) for defended in best}
    if is_most:
        by = ", and by ".join(f"`{name}`, {share}" for name, share in shares.items())
        return f"Of all hazards, the most are prevented by {by}."
    return f"Of all hazards, {' and '.join(f'`{name}` prevents {share}' for name, share in shares.items())}."


def _open_sentences(sets: Iterable[DefendedSet]) -> Iterable[str]:
    facts = {d.name: (d.count_by_outcome[PairOutcome.OPEN], len(hazardous_pairs(d))) for d in sets}
    for (count, of), names in _names_by_facts(facts).items():
        if count:
            ends = "the drive ends" if count == 1 else "the drives end"
            yield (
                f"With {_listed(names)}, no hazard comes in {count} of {counted(of, 'experiment')} that had "
                f"one without defences, but {ends} too early to call it prevented."
            )


def _cost_sentences(sets: Iterable[DefendedSet]) -> Iterable[str]:
    """Say where each set acts although nothing calls for it. Sets with the same numbers share a sentence."""
    facts = {
        defended.name: (
            len(defended.false_goldens),
            sum(pair.is_unneeded_activation for pair in defended.pairs),
            sum(pair.outcome in (PairOutcome.NO_HAZARD, PairOutcome.CAUSED) for pair in defended.pairs),
        )
        for defended in sets
    }
    for (false_count, unneeded, without), names in _names_by_facts(facts).items():
        drives = counted(false_count, "fault-free drive") if false_count else "no fault-free drive"
        acts = "acts" if len(names) == 1 else "each act"
        yield (
            f"{_listed(names)} {acts} in {drives}, and in {unneeded or 'none'} of "
            f"{counted(without, 'experiment')} that had no hazard without defences."
        )


def _names_by_facts(facts_by_name: Mapping[str, _Facts]) -> dict[_Facts, list[str]]:
    names: dict[_Facts, list[str]] = {}
    for name, facts in facts_by_name.items():
        names.setdefault(facts, []).append(name)
    return names


def _listed(names: Sequence[str]) -> str:
    *first, last = (f"`{name}`" for name in names)
    return f"{', '.join(first)} and {last}" if first else last


def _caused_sentence(sets: Sequence[DefendedSet]) -> str:
    """Say how many hazards each set caused, with the worst of each."""
    caused = {defended.name: defended.select(PairOutcome.CAUSED) for defended in sets}
    parts = [_caused_text(name, pairs) for name, pairs in caused.items() if pairs]
    if not parts:
        return "No set caused a hazard in an experiment that had none."
    listed = "; ".join(parts)
    return f"Hazards in experiments that had none: {listed}. All are in `tables/defended_pairs.csv`."


def _caused_text(name: str, pairs: Sequence[DefendedPair]) -> str:
    worst = pairs[0]
    hazards = ", ".join(hazard for hazard, _ in worst.defended.hazards)
    return (
        f"`{name}` caused {len(pairs)}, the worst of them {hazards} with {worst.undefended.fault} in "
        f"{worst.undefended.scenario_label} (`{worst.undefended.experiment_id}`)"
    )


def _latency_sentence(step_s: float | None) -> str:
    length = "one step" if step_s is None else f"one step, here {1000 * step_s:g} ms"
    return (
        f"A defence decides at the end of a step and acts from the next one: that latency, {length}, is part "
        "of its reaction time."
    )
