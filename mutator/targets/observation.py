"""Where a target's ground truth is observed, as its manifest has it."""

import ast
from dataclasses import dataclass
from pathlib import Path

from mutator.config.locations import AtModel, dotted_name
from mutator.config.yaml_files import Source, StrictModel
from mutator.errors import MutatorError
from mutator.model import FaultLocation
from mutator.targets.paths import inside

OBSERVED = ("t", "d_rel", "v_ego", "v_lead")
_READING = (ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.UAdd, ast.USub, ast.Load)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """Where ground truth is observed, and the target's expressions for it.

    `expressions` gives, for each of t, d_rel, v_ego, v_lead, an expression valid at the location.
    """

    location: FaultLocation
    expressions: tuple[tuple[str, str], ...]


class ObservationModel(StrictModel):
    """Anchor and expressions."""

    at: AtModel
    t: str
    d_rel: str
    v_ego: str
    v_lead: str


def observation(model: ObservationModel, source: Source, root: Path) -> Observation:
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
                f"'{getattr(model, name)}'",
                expected="a local name or attribute, a number, or a sum, difference or product of them",
                remedy="say where the value is at that statement",
            ) from None
    return Observation(location=location, expressions=tuple(expressions))


def _expression(text: str) -> str:
    """The text of an expression that does nothing but read and reckon; ValueError for any other."""
    tree = ast.parse(text.strip(), mode="eval").body
    for node in ast.walk(tree):
        constant = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        name = isinstance(node, ast.Name | ast.Attribute) and dotted_name(ast.unparse(node))
        if not (constant or name or isinstance(node, _READING)):
            raise ValueError(text)
    return ast.unparse(tree)
