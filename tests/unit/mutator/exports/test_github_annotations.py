"""Annotations on GitHub."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.fault_positions import SourcePosition
from mutator.errors import MutatorError
from mutator.exports.github_annotations import annotation_commands, error_command, workflow_command
from mutator.exports.highlights import Highlight
from mutator.model import Experiment

MakeHighlight = Callable[..., Highlight]


@pytest.fixture
def highlight(experiment: Callable[..., Experiment]) -> MakeHighlight:
    def make(**given: Any) -> Highlight:
        fields: dict[str, Any] = {
            "experiment": experiment(),
            "title": "new-hazard, new-silent-hazard",
            "description": "sensor/lane/shifted 1 m, A, guided C1: sdc -> hazard (H3)",
            "sentence": "The lane moves. No alert.",
            "position": SourcePosition(path="car/a b.py", first_line=7, last_line=9),
        }
        return Highlight(**fields | given)

    return make


def unescaped(text: str) -> str:
    """What the runner makes of a value."""
    for code, character in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
        text = text.replace(code, character)
    return text


def test_an_annotation_names_file_and_lines_and_what_happened(highlight: MakeHighlight) -> None:
    each = highlight()
    [command] = annotation_commands([each], "error")
    assert command == (
        "::error file=car/a b.py,line=7,endLine=9,title=new-hazard%2C new-silent-hazard::"
        f"sensor/lane/shifted 1 m, A, guided C1: sdc -> hazard (H3) [{each.experiment.id[:8]}]%0A"
        "The lane moves. No alert."
    )


def test_an_experiment_without_a_place_is_annotated_without_a_file(highlight: MakeHighlight) -> None:
    [command] = annotation_commands([highlight(position=None, sentence="")], "warning")
    assert command.startswith("::warning title=new-hazard%2C new-silent-hazard::sensor/lane")
    assert "%0A" not in command


@pytest.mark.parametrize("text", ["100 % :, \r\n::stop", "%0A", "%25,", "ä☃"])
def test_no_text_can_end_its_command_or_become_another(text: str) -> None:
    command = workflow_command("notice", {"file": text, "title": text}, text)
    assert len(command.splitlines()) == 1
    head, _, message = command.removeprefix("::notice ").partition("::")
    assert unescaped(message) == text
    assert [unescaped(part.partition("=")[2]) for part in head.split(",")] == [text, text]


def test_ten_are_annotated_and_the_others_counted(highlight: MakeHighlight) -> None:
    commands = annotation_commands([highlight()] * 12, "error")
    assert [command.split(" ")[0] for command in commands[:10]] == ["::error"] * 10
    assert commands[10:] == ["::notice::and 2 more experiments: see the summary of this job"]
    assert len(annotation_commands([highlight()] * 10, "error")) == 10
    assert annotation_commands([], "error") == []


def test_an_error_outside_of_the_repository_has_no_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, outside = tmp_path / "repository" / "a.yaml", tmp_path / "b.yaml"
    (tmp_path / "repository" / ".git").mkdir(parents=True)
    monkeypatch.chdir(inside.parent)
    found = error_command(MutatorError("wrong", where=inside, line=3, expected="right"))
    assert found == f"::error file=a.yaml,line=3::{inside}:3: wrong; expected right"
    assert error_command(MutatorError("wrong", where=outside, line=3)) == f"::error::{outside}:3: wrong"
    assert error_command(MutatorError("wrong", where=inside)) == f"::error::{inside}: wrong"
