"""`init`: a library of one's own."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`, gives code, out, err, json


def test_init_writes_a_library_that_is_then_used(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After `init` the verbs given in that folder list what is edited there."""
    assert cli("init", "faults").out.startswith("faults: fault_library/, templates/ and a README.md")
    spec = nowhere / "faults/fault_library/faults/radar/chaff.yaml"
    spec.write_text(spec.read_text().replace("The radar's echo", "My radar's echo"))
    assert "My radar" not in cli("list", "specs").out
    monkeypatch.chdir(nowhere / "faults")
    assert "My radar's echo" in cli("list", "specs").out
    assert cli("check").code == 0


def test_the_readme_names_commands_that_exist(cli: Cli, nowhere: Path) -> None:
    """The five commands of the README are verbs of the command line."""
    cli("init", "faults")
    readme = (nowhere / "faults" / "README.md").read_text()
    block = readme.split("```sh\n")[1].split("```")[0]
    verbs = [line.split()[1] for line in block.splitlines()]
    assert verbs == ["list", "try", "check", "run", "show"]
    assert all(cli(verb, "--help").code == 0 for verb in verbs)


def test_init_refuses_a_folder_with_content(cli: Cli, nowhere: Path) -> None:
    """A folder that holds anything is wrong input, and stays as it is."""
    (nowhere / "thesis.tex").touch()
    answer = cli("init", ".")
    assert answer.code == 2
    assert "not empty (thesis.tex)" in answer.err
    assert [path.name for path in nowhere.iterdir()] == ["thesis.tex"]


def test_init_for_a_program(cli: Cli, nowhere: Path) -> None:
    """`--json` names the folder."""
    assert cli("init", "faults", "--json").json == {"folder": "faults"}
