"""Help, errors, exit codes and start-up of the command line."""

import errno
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from mutator import __version__
from mutator.cli import list_check_doctor_commands
from mutator.cli.app import SUBCOMMAND_GROUPS, app, main
from mutator.errors import EXIT_CHECK_FAILED, CheckFailed, MutatorError

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json

VERBS = [verb for _, verbs in SUBCOMMAND_GROUPS for verb in verbs]
HEAVY = ("pandas", "libcst", "matplotlib", "pydantic", "rich", "jinja2", "pyarrow", "numpy", "pytest")


def test_every_verb_is_in_the_help_under_a_heading(cli: Cli) -> None:
    answer = cli("--help")
    assert answer.code == 0
    registered = [*app.registered_commands, *app.registered_groups]
    assert sorted(VERBS) == sorted(verb.name or "" for verb in registered)
    for title, verbs in SUBCOMMAND_GROUPS:
        assert f"{title}:" in answer.out
        assert all(f"\n  {verb} " in answer.out for verb in verbs)


def subcommands(group: Any = None, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the words of every subcommand, also of those in a group such as `review`."""
    for name, command in (group or get_command(app)).commands.items():
        yield (*words, name)
        if hasattr(command, "commands"):
            yield from subcommands(command, (*words, name))


@pytest.mark.parametrize("words", list(subcommands()), ids=" ".join)
def test_each_subcommand_has_a_help_text(cli: Cli, words: tuple[str, ...]) -> None:
    """It shows neither brackets in brackets nor the parser's notation for a range."""
    answer = cli(*words, "--help")
    assert answer.code == 0
    assert answer.out.startswith(f"Usage: mutator {' '.join(words)} ")
    assert not [line for line in answer.out.splitlines() if "[[" in line or "<=x" in line or "x>=" in line]


def test_the_help_names_the_least_and_the_greatest_value(cli: Cli) -> None:
    text = " ".join(cli("serve", "--help").out.split())
    assert "[default: 0; 0 to 65535]" in text
    assert "[default: 1; 1 to 16]" in text


def test_without_arguments_the_help_is_printed(cli: Cli) -> None:
    assert cli() == cli("--help")


def test_the_version_is_printed(cli: Cli) -> None:
    assert cli("--version").out == f"mutator {__version__}\n"


def test_help_needs_no_heavy_package() -> None:
    code = (
        "import sys, mutator.cli.app as m; m.main(['--help']);"
        f"print([x for x in {HEAVY} if x in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_list_imports_no_heavy_packages() -> None:
    """`list` reads only YAML."""
    code = (
        "import sys, mutator.cli.app as m; m.main(['list']);"
        "print([x for x in ('libcst', 'matplotlib', 'pandas', 'pyarrow') if x in sys.modules])"
    )
    clone = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=clone)
    assert done.stdout.splitlines()[-1] == "[]"


def test_resume_show_and_check_load_packages_for_tables_only_when_they_are_needed() -> None:
    """Modules that these verbs import name pandas only in annotations, or in functions that need it."""
    modules = "mutator.api.runs, mutator.checks.library_check, mutator.execution.campaign_running"
    code = (
        f"import sys, {modules}, mutator.paper.study;"
        "print([x for x in ('matplotlib', 'pandas', 'pyarrow', 'scipy') if x in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_python_m_mutator_is_mutator() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mutator", "lst"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "Did you mean 'list'?" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nonsense"], "No such command 'nonsense'"),
        (["plan"], "Missing argument 'CAMPAIGN'"),
        (["list", "--wrong"], "No such option: --wrong"),
        (["plan", "x", "--out", "y", "--limit", "0"], "--limit"),
        (["list", "cars"], "'cars'"),
    ],
)
def test_a_usage_error_exits_with_2_and_names_the_help(cli: Cli, words: list[str], said: str) -> None:
    answer = cli(*words)
    assert answer.code == 2
    assert said in answer.err
    assert "--help" in answer.err
    assert "Traceback" not in answer.err


def test_an_empty_folder_uses_the_shipped_library(cli: Cli, nowhere: Path) -> None:
    answer = cli("list", "specs")
    assert answer.code == 0
    assert "radar/chaff" in answer.out


def test_a_missing_library_is_reported(cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(nowhere / "gone"))
    answer = cli("list")
    assert answer.code == 2
    assert "--root" in answer.err
    assert "MUTATOR_ROOT" in answer.err
    assert "Traceback" not in answer.err


def test_library_and_templates_are_found_by_options(cli: Cli, root: Path, nowhere: Path) -> None:
    place = ["--root", root.parent, "--library", root / "fault_library", "--templates", root / "templates"]
    before, after = cli(*place, "list", "specs"), cli("list", "specs", *place)
    assert before.code == after.code == 0
    assert "sensor/distance" in before.out
    assert before.out == after.out


def fail_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def broken(_: object) -> None:
        raise error

    monkeypatch.setitem(
        list_check_doctor_commands.LIST_BY_KIND, list_check_doctor_commands.EntryKind.SPECS, broken
    )


def test_an_error_shows_place_expectation_and_remedy(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = Path.cwd() / "spec.yaml"
    fail_with(monkeypatch, MutatorError("[bold]x", where=here, line=7, expected="a number", remedy="mend it"))
    answer = cli("list", "specs")
    assert answer.code == 2
    assert answer.err == "error: spec.yaml:7: [bold]x\n  expected: a number\n  to do: mend it\n"
    assert answer.out == ""


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (CheckFailed("the canary sings"), EXIT_CHECK_FAILED, "the canary sings"),
        (OSError(errno.ENOSPC, "No space left on device", "/full"), 3, "/full: no space left"),
        (RuntimeError("cannot encode: Disk quota exceeded"), 3, "no space left on this disk"),
        (OSError(errno.EACCES, "Permission denied", "/shut"), 2, "/shut: Permission denied"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_exit_codes_of_errors(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, said: str
) -> None:
    fail_with(monkeypatch, error)
    answer = cli("list", "specs")
    assert answer.code == code
    assert said in answer.err
    assert "Traceback" not in answer.err


def test_an_unexpected_error_is_a_defect_with_a_traceback(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail_with(monkeypatch, ZeroDivisionError("oops"))
    answer = cli("list", "specs")
    assert answer.code == 3
    assert "ZeroDivisionError: oops" in answer.err
    assert "bug in mutator" in answer.err


@pytest.mark.parametrize("words", ["list --json", "list targets", "--help"], ids=["long", "short", "help"])
def test_a_closed_pipe_is_not_an_error(words: str) -> None:
    clone = Path(__file__).parents[2]
    command = f"{sys.executable} -m mutator {words} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=clone)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_main_returns_the_code_of_a_verb(root: Path) -> None:
    assert main(["list", "targets"]) == 0


@pytest.mark.parametrize(
    "streams",
    [
        "os.close(0); os.close(1); os.close(2)",
        "read, write = os.pipe(); os.close(read); os.dup2(write, 2)",
        "os.dup2(os.open('/dev/full', os.O_RDWR), 2)",
    ],
)
def test_a_command_works_without_standard_error(root: Path, tmp_path: Path, streams: str) -> None:
    words = ["plan", "small", "--out", str(tmp_path / "run"), "--root", str(root)]
    begin = f"import os, sys; {streams}; os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    for code in (0, 2):
        done = subprocess.run([sys.executable, "-c", begin, "-m", "mutator", *words], check=False)
        assert done.returncode == code
        assert (tmp_path / "run" / "plan.csv").is_file()
        words[1] = "unknown"
