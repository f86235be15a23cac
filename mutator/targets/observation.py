"""Where a target's ground truth is observed, as its manifest has it."""

import ast
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from mutator._common.text import shown
from mutator.config.locations import AtModel, dotted_name
from mutator.config.yaml_files import Source, StrictModel
from mutator.errors import MutatorError
from mutator.model import FaultLocation
from mutator.targets.paths import inside

OBSERVED = ("t", "d_rel", "v_ego", "v_lead")
_LONGEST = 1000  # characters of an expression
_READING = (ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.UAdd, ast.USub, ast.Load)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """Where ground truth is observed, and the target's expressions for it.

    `expressions` gives, for each of t, d_rel, v_ego, v_lead, an expression valid at the location.
    """

    location: FaultLocation
    expressions: tuple[tuple[str, str], ...]


class ObservationModel(StrictModel, title="The observation"):
    """Where ground truth is read, once in each step: time goes on from one to the next, or starts again with
    another run. Each value is a name or attribute that the place knows, a number, or a sum, difference or
    product of these."""

    at: AtModel = Field(description="The place; values are read there.")
    t: str = Field(description="Time in s.")
    d_rel: str = Field(description="Distance to the vehicle ahead in m.")
    v_ego: str = Field(description="The car's own speed in m/s.")
    v_lead: str = Field(description="Speed of the vehicle ahead in m/s.")


def read_observation(model: ObservationModel, source: Source, root: Path) -> Observation:
    """The observation of a manifest; errors point into `source`."""
    location = model.at.location(source, ("observation", "at"))
    try:
        inside(root, location.path)
    except MutatorError as error:
        raise source.error(
            ("observation", "at", "file"), error.got, expected=error.expected, remedy=error.remedy
        ) from None
    expressions = []
    for name in OBSERVED:
        try:
            expressions.append((name, _expression(getattr(model, name))))
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise source.error(
                ("observation", name),
                shown(getattr(model, name)),
                expected="a local name or attribute, a number, or a sum, difference or product of them",
                remedy="say where the value is at that statement",
            ) from None
    return Observation(location=location, expressions=tuple(expressions))


def _expression(text: str) -> str:
    """The text of an expression that does nothing but read and reckon; ValueError for any other."""
    if len(text) > _LONGEST:
        raise ValueError(text)
    tree = ast.parse(text.strip(), mode="eval").body
    for node in ast.walk(tree):
        constant = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        name = isinstance(node, ast.Name | ast.Attribute) and dotted_name(ast.unparse(node))
        if not (constant or name or isinstance(node, _READING)):
            raise ValueError(text)
    return ast.unparse(tree)
