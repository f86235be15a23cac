"""Fault models: what a fault does to a statement. Each is a Jinja2 template and a YAML, no Python."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path


class SnippetKind(StrEnum):
    """How a snippet meets the anchored statement."""

    INSERT = "insert"  # lines before or after it
    GUARD = "guard"  # one line above it, the statement indented beneath


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSchema:
    """One parameter of a model. `unit`: None (plain number), 'target' (the unit of the changed variable), or
    the unit the template wants (`s`)."""

    name: str
    type: str  # variable, number, integer, boolean, seed
    about: str
    unit: str | None = None
    optional: bool = False
    min: float | None = None
    max: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A source before and after one injection: documentation that is run as a test."""

    about: str
    injection: Mapping[str, object]
    value: float | int | None
    before: str
    after: str
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultModel:
    """A fault model: template text, parameter schema, examples; `digest` covers template and YAML."""

    name: str
    kind: SnippetKind
    summary: str
    params: tuple[ParamSchema, ...]
    examples: tuple[Example, ...]
    template: str
    path: Path  # the YAML
    template_path: Path
    digest: str


@dataclass(frozen=True)
class FaultModels:
    """All fault models of a templates folder, by name, and the probe's template."""

    folder: Path
    models: Mapping[str, FaultModel]
    probe: str
    digest: str  # of every template, schema and the probe

    def __iter__(self) -> Iterator[FaultModel]:
        return iter(self.models.values())

    def get(self, name: str) -> FaultModel:
        """The model `name`; MutatorError that lists the known ones."""
        raise NotImplementedError


def load_fault_models(folder: Path) -> FaultModels:
    """Read every `<model>.yaml` and `<model>.py.j2` of `folder`, and `_fi.py.j2`."""
    raise NotImplementedError
