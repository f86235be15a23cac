"""Limits injections to one instance or to some executions by adding a check before the probe's own check."""

from mutator.config.instances import names_of
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel
from mutator.model import Injection
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.injected_lines import asks, asks_for


def check_instance(file: ParsedFile, names: frozenset[str], first: int, injection: Injection) -> None:
    unknown = names_of(injection.where or "True") - names
    if unknown:
        raise MutatorError(
            f"'{min(unknown)}' in `where` is not known in {injection.location.function}",
            where=file.where,
            line=first + 1,
            expected=f"names used there: {', '.join(sorted(names))}",
            remedy="correct `where`",
        )


def limited(code: tuple[str, ...], injection: Injection, name: str, model: FaultModel) -> tuple[str, ...]:
    """Add to the snippet a check for the instance or executions that the injection selects, if any."""
    plain, asked = asks(name), asks_for(name, injection)
    if asked == plain:
        return code
    heads = {f"if {plain}:": f"if {asked}:", f"if not {plain}:": f"if not ({asked}):"}
    if sum(line.count(plain) for line in code) != 1 or not any(line in heads for line in code):
        raise MutatorError(
            f"model {model.name}, with these parameters, cannot be limited by `where`, `call` or `every`",
            where=model.template_path,
            expected=f"a template with exactly one probe check, `if {plain}:` or `if not {plain}:`",
            remedy="remove `where`, `call` and `every`, or use another model",
        )
    return tuple(heads.get(line, line) for line in code)
