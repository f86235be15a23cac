"""Generate docs/reference/cli.md from the source of `--help`."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any

import pytest
from typer.main import get_command

from mutator._common.table_rendering import TextTable
from mutator.cli.app import EXIT_CODES, SUBCOMMAND_GROUPS, app
from mutator.cli.shared_options import WorkspaceOptions
from mutator.cli.subcommand_help import help_record
from mutator.execution import pytest_plugin
from mutator.reference.yaml_key_tables import generated_page_head
from mutator.workspace import Workspace

_WORKSPACE_OPTIONS = {field.name for field in fields(WorkspaceOptions)}
_WORKSPACE_OPTIONS_NOTE = (
    "These options say where the library, templates and target are. Write them before or after the "
    "subcommand.\n"
)


def render_command_line_page(workspace: Workspace) -> str:
    command: Any = get_command(app)
    parts = [
        generated_page_head("Command line"),
        "`mutator --help` and `mutator SUBCOMMAND --help` print the same information.\n",
        *(
            f"* {title}: {', '.join(f'[{name}](#{name})' for name in names)}"
            for title, names in SUBCOMMAND_GROUPS
        ),
        "\n## Exit codes\n",
        _table_markdown(("code", "meaning"), [(str(code), meaning) for code, meaning in EXIT_CODES.items()]),
        "\nCode 1 also means that a command found a difference that you asked it to look for. Code 3 also "
        "means a bug in\nmutator itself, reported with a traceback.\n",
        "Errors go to standard error: file and line, what was found, what was expected, and what to do. "
        "Progress also goes\nto standard error. With `--json`, standard output is one JSON document.\n",
        "## Completion\n",
        "`mutator --install-completion` installs completion for the current shell: subcommands, options, "
        "campaigns,\nspecs, scenarios, targets, run folders in `runs/`, and experiments of the run that "
        "`--run` names or of the newest\nrun. `mutator --show-completion` prints its script.\n",
        "## Library, templates and target\n",
        _WORKSPACE_OPTIONS_NOTE,
        *_options_table(command, [p for p in command.params if p.name in _WORKSPACE_OPTIONS]),
    ]
    for _, names in SUBCOMMAND_GROUPS:
        for name in names:
            parts += _subcommand_section(command, name)
    return "\n".join([*parts, *_pytest_section()]).rstrip() + "\n"


def _subcommand_section(group: Any, name: str) -> Iterator[str]:
    command = group.commands[name]
    yield f"## {name}\n"
    parent = group.make_context("mutator", [name])
    # resilient: otherwise, Click would demand the arguments
    with command.make_context(name, [], parent=parent, resilient_parsing=True) as ctx:
        usage = " ".join(command.get_usage(ctx).removeprefix("Usage: ").split())
    yield f"```text\n{usage}\n```\n"
    yield f"{_unwrap_paragraphs(command.help)}\n"
    params = [param for param in command.params if param.name not in (*_WORKSPACE_OPTIONS, "help")]
    yield from _options_table(command, params)
    if command.epilog:
        # Click's mark of lines that it must not fold
        title, _, lines = command.epilog.replace("\b", "").strip().partition("\n")
        examples, _, rest = lines.partition("\n\n")
        yield f"{title}\n\n```sh\n" + "\n".join(map(_example_line, examples.splitlines())) + "\n```\n"
        if rest:
            yield f"{rest.strip()}\n"


def _example_line(line: str) -> str:
    command, gap, comment = re.match(r"  (.*?)(?:( {2,})(\S.*))?$", line).groups()  # type: ignore[union-attr]
    return f"{command}{gap}# {comment}" if gap else command


def _options_table(command: Any, params: Iterable[Any]) -> Iterator[str]:
    rows = []
    with command.make_context("mutator", [], resilient_parsing=True) as ctx:
        for param in params:
            if record := help_record(param, ctx):
                left, right = (" ".join(text.replace("|", r"\|").split()) for text in record)
                rows.append((f"`{left}`", right))
    if rows:
        yield from (_table_markdown(("argument or option", "meaning"), rows), "")


def _unwrap_paragraphs(text: str) -> str:
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


def _pytest_section() -> Iterator[str]:
    parser = pytest.Parser(_ispytest=True)
    pytest_plugin.pytest_addoption(parser)
    yield "## pytest\n"
    yield (
        "`pytest CAMPAIGN.yaml -n 2` runs a campaign like `mutator run`, with a test for each experiment "
        "([how](../how-to/run-in-pytest.md)).\n"
    )
    rows = [
        (f"`{' '.join(option.names())} {option.attrs()['metavar']}`", str(option.attrs()["help"]))
        for option in parser.getgroup("mutator").options
    ]
    yield _table_markdown(("option", "meaning"), rows)
    yield ""


def _table_markdown(heads: tuple[str, str], rows: list[tuple[str, str]]) -> str:
    return TextTable(heads=heads, rows=rows).as_markdown(escape=False)
