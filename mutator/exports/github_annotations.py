"""Workflow commands of GitHub Actions, which become annotations at lines of a pull request."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from mutator._common.message_text import SHORT_ID_LENGTH, counted
from mutator.campaigns.fault_positions import path_in_repository
from mutator.errors import MutatorError
from mutator.exports.highlights import Highlight

MOST_ANNOTATIONS = 10  # GitHub shows at most ten of each kind for a step
AnnotationKind = Literal["error", "warning", "notice"]


def annotation_commands(highlights: Sequence[Highlight], kind: AnnotationKind) -> list[str]:
    """Return an annotation for each of the first ten experiments, and one with the number of the others."""
    worst = highlights[:MOST_ANNOTATIONS]
    lines = [workflow_command(kind, _properties(each), _message(each)) for each in worst]
    if more := len(highlights[MOST_ANNOTATIONS:]):
        text = f"and {counted(more, 'more experiment')}: see the summary of this job"
        lines.append(workflow_command("notice", {}, text))
    return lines


def _properties(highlight: Highlight) -> dict[str, str]:
    position = highlight.position
    place = (
        {"file": position.path, "line": str(position.first_line), "endLine": str(position.last_line)}
        if position
        else {}
    )
    return place | {"title": highlight.title}


def _message(highlight: Highlight) -> str:
    described = f"{highlight.description} [{highlight.experiment.id[:SHORT_ID_LENGTH]}]"
    return f"{described}\n{highlight.sentence}" if highlight.sentence else described


def error_command(error: MutatorError) -> str:
    """Return the annotation for an error, at its line if it is in a file of the repository."""
    properties = {}
    if error.where and error.line is not None:
        path = path_in_repository(Path(error.where))
        properties = {} if path.startswith("/") else {"file": path, "line": str(error.line)}
    return workflow_command("error", properties, str(error))


def workflow_command(kind: AnnotationKind, properties: Mapping[str, str], message: str) -> str:
    """Return a command line, escaped as the runner reads it."""
    listed = ",".join(f"{name}={_escaped_property(value)}" for name, value in properties.items())
    return f"::{kind} {listed}::{_escaped(message)}" if listed else f"::{kind}::{_escaped(message)}"


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escaped_property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")
