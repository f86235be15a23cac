"""Find draws that no parameter uses, so that all their faults are the same, and parameters that no template
uses.
"""

from collections.abc import Iterator
from itertools import product

from jinja2 import TemplateError
from jinja2.meta import find_undeclared_variables
from jinja2.sandbox import ImmutableSandboxedEnvironment

from mutator.checks.check_findings import CheckState, Finding, FindingPlace
from mutator.faults.fault_models import NAME_PARAM_TYPES, FaultModels, SnippetKind
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.injection_specs import DrawReference, InjectionSpec, parse_draw_reference

_FINDING_NAME = "draws"


def unused_draws_and_parameters_finding(specs: tuple[FaultSpec, ...], models: FaultModels) -> Finding:
    places = [*_unused_draw_places(specs, models), *_unused_parameter_places(models)]
    if not places:
        return Finding(name=_FINDING_NAME, level=CheckState.OK, found="all drawn values are used")
    return Finding(
        name=_FINDING_NAME,
        level=CheckState.WARN,
        found=f"{len(places)} unused",
        remedy="use the value in a parameter (`by_m: NAME`), or remove it, because no fault depends on it",
        places=tuple(places),
    )


def _unused_draw_places(specs: tuple[FaultSpec, ...], models: FaultModels) -> Iterator[FindingPlace]:
    for spec in specs:
        for variant in spec:
            for draw, (reading, injections) in product(
                variant.all_draws, variant.injections_by_reading.items()
            ):
                if not any(_uses_draw(injection, draw.name, models) for injection in injections):
                    where = f" in reading {reading}" if reading else ""
                    what = f"{spec.name}/{variant.name} draws '{draw.name}', unused{where}"
                    yield FindingPlace(file=str(spec.path), line=spec.source.line_of(draw.keys), what=what)


def _uses_draw(injection: InjectionSpec, name: str, models: FaultModels) -> bool:
    model = models.get(injection.model)
    for param in injection.params:
        schema = model.param(param.name)
        drawn = (
            param.value if isinstance(param.value, DrawReference) else parse_draw_reference(str(param.value))
        )
        if schema and schema.type not in NAME_PARAM_TYPES and drawn and drawn.name == name:
            return True
    return False


def _unused_parameter_places(models: FaultModels) -> Iterator[FindingPlace]:
    environment = ImmutableSandboxedEnvironment()
    for model in models:
        try:
            used = find_undeclared_variables(environment.parse(model.template))
        except TemplateError:  # reported when the template is rendered
            continue
        if model.kind is SnippetKind.VALUE:
            used.add("target")  # the expression to change, which the template calls `original`
        for param in model.params:
            if param.name not in used:
                what = f"parameter '{param.name}' of model {model.name}, unused in its template"
                line = model.source.line_of(("params", param.name))
                yield FindingPlace(file=str(model.source.path), line=line, what=what)
