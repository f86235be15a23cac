"""A family of scenarios, as read from its file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from jinja2 import Template, TemplateError, TemplateSyntaxError

from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.families.parameters import Parameter, ParameterValue
from mutator.model import ConcreteScenario
from mutator.mutants.restricted_template_language import TemplateEnvironment
from mutator.triggers.conditions import evaluate_condition

_DECIMALS = 9  # of numbers in a scenario: enough for any unit, without the noise of conversions


@dataclass(frozen=True, kw_only=True)
class Frequency:
    """How often values occur on the road: a probability for each value of some parameters, by name. Values
    of different parameters are taken to be independent.
    """

    source: str
    probabilities: Mapping[str, Sequence[float]]


@dataclass(frozen=True, kw_only=True)
class Family:
    """Scenarios with parameters: what is the same in all of them, and what differs."""

    name: str
    title: str
    source: str  #: where its numbers come from
    path: Path
    parameters: tuple[Parameter, ...]
    constraints: tuple[str, ...]  #: conditions on the parameters' values that each scenario meets
    sampling: str  #: the method of sampling, unless a campaign names another
    frequency: Frequency | None
    template: str
    yaml_source: YamlSource

    @property
    def facts(self) -> FamilyFacts:
        """What a run states about the family."""
        parameters = tuple(parameter.facts for parameter in self.parameters)
        return FamilyFacts(name=self.name, title=self.title, parameters=parameters)

    def concrete(self, values: Sequence[ParameterValue]) -> ConcreteScenario:
        """Return the scenario with these values, one for each parameter in order.

        MutatorError if the template cannot be rendered with them.
        """
        label = ", ".join(
            parameter.describe(value) for parameter, value in zip(self.parameters, values, strict=True)
        )
        return ConcreteScenario(
            family=self.name,
            values={parameter.key: value for parameter, value in zip(self.parameters, values, strict=True)},
            label=label,
            text=self._render(values, label),
        )

    def meets_constraints(self, values: Sequence[ParameterValue]) -> bool:
        if not self.constraints:
            return True
        numbers = {
            name: number
            for name, number in self._names_and_values(values).items()
            if not isinstance(number, str)
        }
        return all(evaluate_condition(constraint, numbers) for constraint in self.constraints)

    def concrete_from_text(self, text: str) -> ConcreteScenario:
        """Return the scenario that `ego=60,gap=20` names; keys can also have their unit: `ego_kph=60`.

        MutatorError unless each parameter with several values has one, and the constraints hold.
        """
        text_by_name: dict[str, str] = {}
        parameters = {name: p for p in self.parameters for name in (p.name, p.key)}
        for part in filter(None, text.split(",")):
            name, equals, value = (piece.strip() for piece in part.partition("="))
            if not equals or name not in parameters:
                raise self._value_error(
                    f"'{part}'",
                    f"NAME=VALUE with {describe_choices([p.name for p in self.parameters])}",
                    spelling_suggestion(name, [p.name for p in self.parameters]),
                )
            if parameters[name].name in text_by_name:
                raise self._value_error(f"'{part}'", f"one value of {parameters[name].name}")
            text_by_name[parameters[name].name] = value
        values = [self._value_from_text(parameter, text_by_name) for parameter in self.parameters]
        if not self.meets_constraints(values):
            raise self._value_error(text, "values with " + " and ".join(self.constraints))
        return self.concrete(values)

    def _value_from_text(self, parameter: Parameter, text_by_name: Mapping[str, str]) -> ParameterValue:
        if parameter.name in text_by_name:
            text = text_by_name[parameter.name]
            if (value := parameter.parse(text)) is not None:
                return value
            raise self._value_error(f"{parameter.name}={text}", parameter.describe_values())
        if len(parameter.values) == 1:
            return parameter.values[0]
        raise self._value_error(
            f"no value of {parameter.name}", f"{parameter.name}=VALUE, {parameter.describe_values()}"
        )

    def _value_error(self, got: str, expected: str, hint: str = "") -> MutatorError:
        example = ",".join(f"{p.name}={p.values[0]}" for p in self.parameters)
        return MutatorError(
            f"family {self.name}: {got}",
            argument="scenario",
            expected=expected,
            remedy=f"write {self.name}:{example}, for example{hint}",
        )

    def _names_and_values(self, values: Sequence[ParameterValue]) -> dict[str, ParameterValue]:
        return {
            name: number
            for parameter, value in zip(self.parameters, values, strict=True)
            for name, number in parameter.numbers_by_name(value).items()
        }

    def _render(self, values: Sequence[ParameterValue], label: str) -> str:
        try:
            return self._compiled.render(**self._names_and_values(values), family=self.name, label=label)
        except TemplateError as err:
            line = self.yaml_source.line_of(("template",))
            names = [name for p in self.parameters for name in p.names_in_templates]
            raise MutatorError(
                f"the template, with {label}: {err}",
                where=self.path,
                line=line,
                expected=f"names among family, label, {', '.join(names)}",
                remedy="correct the template",
            ) from None

    @cached_property
    def _compiled(self) -> Template:
        try:
            return _ENVIRONMENT.compiled_template(self.template)
        except TemplateSyntaxError as err:
            first = self.yaml_source.line_of(("template",)) or 0
            raise MutatorError(
                f"the template: {err.message}",
                where=self.path,
                line=first + err.lineno,  # a block of text begins in the line below its key
                remedy="see docs/reference/family.md for what a template can contain",
            ) from None


def argument_of(scenario: ConcreteScenario) -> str:
    """Return the text that names a concrete scenario: `FAMILY:ego_kph=60,gap_m=20`."""
    return f"{scenario.family}:{','.join(f'{key}={value}' for key, value in scenario.values.items())}"


def _number_text(value: object) -> str:
    if isinstance(value, float):
        rounded = round(value, _DECIMALS)
        return repr(int(rounded)) if rounded.is_integer() else repr(rounded)
    return str(value)


_ENVIRONMENT = TemplateEnvironment(functions={}, filters={}, finalize=_number_text)
