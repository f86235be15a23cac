"""The words for a fault: the phrase of its spec, else those of its fault models, else its label."""

from mutator._common.phrase_texts import (
    ABSOLUTE_PREFIX,
    CHANGED_HOLE,
    FILE_HOLE,
    FUNCTION_HOLE,
    VALUE_HOLE,
    converted_number_text,
    fill_phrase,
    holes_of,
    planned_number_text,
    rounded_number_text,
)
from mutator.config.units import split_key_at_unit
from mutator.model import Fault, Injection, Value
from mutator.targets.stored_phrases import NEGATIVE, POSITIVE, PhraseByCase, Phrases


def describe_fault(fault: Fault, phrases: Phrases) -> str:
    """Return what the fault does, as a clause: `the speed sensor reads 50 mph too low`."""
    by_spec = _spec_clause(fault, phrases.faults.get(fault.spec, {}))
    return by_spec or _model_clause(fault, phrases) or fault.label


def _spec_clause(fault: Fault, phrase: PhraseByCase) -> str:
    texts = phrase.get("") or phrase.get(NEGATIVE if _is_negative(fault.value) else POSITIVE, ())
    values = _value_texts(VALUE_HOLE, fault.value, fault.unit)
    for text in texts:
        for hole in holes_of(text):
            values |= (
                _parameter_texts(fault, hole.removeprefix(ABSOLUTE_PREFIX)) if hole not in values else {}
            )
    return fill_phrase(texts, values)


def _parameter_texts(fault: Fault, hole: str) -> dict[str, str]:
    """Return the texts of a parameter that a hole names with its unit: `by_kph`."""
    name, unit = split_key_at_unit(hole)
    for injection in fault.injections:
        params = dict(injection.params)
        for key, symbol in ((hole, ""), (name, unit.symbol if unit else "")):
            if isinstance(number := params.get(key), int | float):
                text, absolute = (converted_number_text(value, symbol) for value in (number, abs(number)))
                return _number_texts(hole, text, absolute)
    return {}


def _model_clause(fault: Fault, phrases: Phrases) -> str:
    clauses = [
        fill_phrase(phrases.models.get(injection.model, {}).get("", ()), _injection_texts(injection))
        for injection in fault.injections
    ]
    return " and ".join(dict.fromkeys(clauses)) if all(clauses) else ""


def _injection_texts(injection: Injection) -> dict[str, str]:
    location, params = injection.location, dict(injection.params)
    changed = params.get("target") or location.anchor.name or location.function
    texts = {
        CHANGED_HOLE: f"`{changed}`",
        FUNCTION_HOLE: f"`{location.function or location.path}`",
        FILE_HOLE: location.path,
    }
    for name, value in params.items():
        if isinstance(value, float):  # often converted from another unit
            texts |= _number_texts(name, rounded_number_text(value), rounded_number_text(abs(value)))
        else:
            texts |= {name: "None"} if value is None else _value_texts(name, value, "")
    return texts


def _value_texts(name: str, value: Value, unit: str) -> dict[str, str]:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return {} if value is None else {name: str(value)}
    return _number_texts(name, planned_number_text(value, unit), planned_number_text(abs(value), unit))


def _number_texts(name: str, text: str, absolute: str) -> dict[str, str]:
    return {name: text, f"{ABSOLUTE_PREFIX}{name}": absolute}


def _is_negative(value: Value) -> bool:
    return isinstance(value, int | float) and value < 0
