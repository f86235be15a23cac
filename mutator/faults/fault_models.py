"""Fault models: what a fault does to a statement. Each is a Jinja2 template and a YAML file."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Literal

from mutator._common.message_text import spelling_suggestion
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.injection_specs import InjectionSpec
from mutator.faults.probe_template_parts import ProbeTemplates
from mutator.targets.stored_phrases import PhraseByCase

TEMPLATE_FOLDER_GLOBS = ("*.yaml", "*.j2")  # what a templates folder consists of
UNIT_OF_CHANGED_VARIABLE = "target"
ParamType = Literal[
    "variable",
    "import",
    "number",
    "integer",
    "boolean",
    "constant",
    "choice",
    "unit",
    "seed",
    "expression",
]
NAME_PARAM_TYPES = ("variable", "import")
_EXPRESSION_PART_PATTERN = re.compile(r"\b(?:left|right|called|arguments)\b")


class SnippetKind(StrEnum):
    """How a snippet changes the anchored statement."""

    INSERT = "insert"  # lines before or after it
    GUARD = "guard"  # lines above it that open a block, with the statement indented beneath
    VALUE = "value"  # a new value for the anchored expression or the assigned variable


class TemplateNeed(StrEnum):
    """What a template needs in addition to its parameters."""

    CALL = "call"  # the anchored expression is a call: `called`, `arguments`
    STATEMENT = "statement"  # the text of the anchored statement: `statement`
    NEXT_STATEMENT = "next_statement"  # also the text of the statement after it: `next_statement`


@dataclass(frozen=True, slots=True, kw_only=True)
class UnnamedParamSchema:
    """The key is the parameter's name without a unit. A spec adds the unit: `by_m` for the parameter `by`."""

    __pydantic_config__ = pydantic_mapping_config("A parameter")

    type: ParamType = field(
        metadata=yaml_metadata(
            "The type of a value. `variable`: a name in the function. `import`: a dotted name to import. "
            "`number`, `integer`, `boolean`: a value of that type. `constant`: a number, truth value, text "
            "or null. `choice`: one of the terms in `choices`. `unit`: the suffix of a unit. `expression`: "
            "an expression of `message`. `seed`: drawn during expansion; a spec cannot set it."
        )
    )
    about: str = field(metadata=yaml_metadata("What the parameter is."))
    unit: str | None = field(
        default=None,
        metadata=yaml_metadata(
            "The unit that the template expects, or `target` for the unit of the changed variable. Default: "
            "no unit."
        ),
    )
    optional: bool = field(
        default=False,
        metadata=yaml_metadata("Whether a spec can omit the parameter. The template then gets `none`."),
    )
    min: float | None = field(default=None, metadata=yaml_metadata("The minimum, in the parameter's unit."))
    max: float | None = field(default=None, metadata=yaml_metadata("The maximum, in the parameter's unit."))
    neutral: float | None = field(
        default=None,
        metadata=yaml_metadata(
            "The value with which a fault changes nothing. Plans and `try` warn about it."
        ),
    )
    choices: tuple[str, ...] = field(
        default=(),
        metadata=yaml_metadata(
            "The terms that a `choice` allows. The template writes them verbatim.", strict=False
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSchema(UnnamedParamSchema):
    """A parameter of a model, with its name."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultModelExample:
    """Documentation that runs as a test: source before and after one injection, tagged `example`."""

    about: str
    injection: InjectionSpec
    before: str
    after: str
    line: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultModel:
    """A fault model: template text, parameter schema, examples.

    `raises`: the injected lines raise on purpose, so an exception in them is a crash of the target.
    `expression_template` is that of a changed value, or None if the model cannot change an expression.
    `needs`: what the templates need, which not every kind of anchor provides. `phrase`: what an injection
    does, in words, for specs without a phrase.
    """

    name: str
    kind: SnippetKind
    about: str
    raises: bool = False
    needs: TemplateNeed | None = None
    params: tuple[ParamSchema, ...]
    examples: tuple[FaultModelExample, ...]
    template: str
    expression_template: str | None = None
    source: YamlSource  # the YAML
    template_path: Path
    phrase: PhraseByCase = field(default_factory=dict)

    def param(self, name: str) -> ParamSchema | None:
        return next((p for p in self.params if p.name == name), None)

    @property
    def expression_parts(self) -> frozenset[str]:
        """The parts of an expression that the value template needs in addition to the whole."""
        return frozenset(_EXPRESSION_PART_PATTERN.findall(self.expression_template or ""))

    def is_neutral(self, params: Mapping[str, object]) -> bool:
        """Return whether these values certainly change nothing.

        False if an optional bound is set, because a bound can change a value that is otherwise left alone.
        """
        bounded = any(p.optional and p.type == "number" and p.name in params for p in self.params)
        neutral = (p.neutral is not None and params.get(p.name) == p.neutral for p in self.params)
        return any(neutral) and not bounded


@dataclass(frozen=True)
class FaultModels:
    """All fault models of a templates folder by name, and the probe's templates."""

    folder: Path
    models: Mapping[str, FaultModel]
    probe_templates: ProbeTemplates
    digest: str  # of everything that determines a mutant's text, and of which models raise

    def __iter__(self) -> Iterator[FaultModel]:
        return iter(self.models.values())

    def get(self, name: str) -> FaultModel:
        if name not in self.models:
            raise MutatorError(
                f"unknown fault model '{name}'",
                expected=f"one of {', '.join(self.models)}",
                remedy=f"correct the name, or add the model to {self.folder}"
                + spelling_suggestion(name, list(self.models)),
            )
        return self.models[name]
