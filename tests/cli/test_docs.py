"""README and docs show what the commands print, and their links work.

The test follows a page as a reader does: it runs the commands in order (`cd FOLDER`, as a command of its own,
holds for those that follow), writes a block after a line with a file name (`` `late.yaml`: ``) to that file,
and applies diffs. If your change alters the output, write it into the pages with
`UPDATE_DOCS=1 pytest -m slow tests/cli/test_docs.py`, and read the difference.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from mutator.cli.app import app
from mutator.reference.generated_files import SCHEMAS_FOLDER
from mutator.reference.json_schemas import yaml_formats
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]
README = CLONE / "README.md"
CONTRIBUTING = CLONE / "CONTRIBUTING.md"
BENCHMARKS = CLONE / "benchmarks" / "README.md"
EXAMPLES = {  # pages, and the package that their commands need
    CLONE / "examples" / folder / "README.md": package
    for folder, package in (("cartpole", "gymnasium"), ("highway", "highway_env"), ("opendbc", "opendbc"))
}
PAGES = [README, CONTRIBUTING, BENCHMARKS, *sorted((CLONE / "docs").rglob("*.md"))]
PAGES += [CLONE / "examples" / "README.md", CLONE / "examples" / "openpilot" / "README.md", *EXAMPLES]
TUTORIAL = CLONE / "docs" / "tutorial" / "first-campaign.md"
HOW_TO = CLONE / "docs" / "how-to"
PAPER_RESULTS = CLONE / "docs" / "explanation" / "paper-results.md"
COMPARISON = HOW_TO / "compare-with-openpilot.md"
WORKED_THROUGH = [
    README,
    TUTORIAL,
    TUTORIAL.with_name("first-fault.md"),
    TUTORIAL.with_name("your-own-controller.md"),
    TUTORIAL.with_name("tour-safety-engineer.md"),
    TUTORIAL.with_name("tour-controller-developer.md"),
    TUTORIAL.with_name("tour-researcher.md"),
    TUTORIAL.with_name("sensor-requirement.md"),
    COMPARISON,
    HOW_TO / "inject-into-messages.md",
    *sorted(set(HOW_TO.glob("add-a-*.md")) - {HOW_TO / "add-a-study.md"}),  # test_studies runs its code
    *EXAMPLES,
]
INDEX = CLONE / "docs" / "README.md"

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
CAMPAIGN = "mutator run quickstart "  # README and tutorial show its table
TABLE = re.compile(r"^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"(?:^([^\n]*)\n\n)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"`([^`\s]+)`[^`]*:$")
# Links to pages and images, but not to the web.
LINK = re.compile(r"\]\(([^)#:\s]*)(?:#([^)\s]+))?\)")
IMAGE = re.compile(r"""<(?:img|source) [^>]*\bsrc(?:set)?="([^"#:\s]+)\"""")
# Digests of a run change with the target's tree, with Python and with packages, so pages show an ellipsis.
DIGEST = "[0-9a-f]{64}"
# Parts that differ between machines: durations, and digests of versions, of golden runs and of dates.
VARYING = re.compile(
    r"\d+ h \d\d min|\d+ min \d\d s|(?<![.\d])\d+ s\b|\d\.\d s each|(?<=^seal: )SUM$"
    r"|(?<=^results digest: )SUM$|(?<=^review digest: )SUM$".replace("SUM", f"(?:{DIGEST}|…)")
)


def name(page: Path) -> str:
    return page.relative_to(CLONE).as_posix()


def sessions(page: Path) -> list[tuple[str, list[str]]]:
    return [step for step in steps(page) if isinstance(step[1], list)]  # type: ignore[misc]


def steps(page: Path) -> list[tuple[str, list[str] | str]]:
    """Return a reader's steps in order: (command, lines it prints), (file, its text) or ("", a diff)."""
    found: list[tuple[str, list[str] | str]] = []
    for before, kind, text in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "console":
            found += _commands(text)
        elif kind == "diff" and FILE.search(before):
            found.append(("", text))
        elif kind and (file := FILE.search(before)):
            found.append((file[1], text))
    return found


def _commands(block: str) -> list[tuple[str, list[str]]]:
    found: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


@pytest.fixture
def work(tmp_path: Path) -> Path:
    for folder in ("fault_library", "templates", "target"):
        shutil.copytree(CLONE / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for toy in (Path("tests") / "toy", Path("tests") / "pole"):
        shutil.copytree(CLONE / toy, tmp_path / toy, ignore=shutil.ignore_patterns("__pycache__"))
    examples = CLONE / "examples"
    shutil.copytree(examples, tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__", "runs"))
    return tmp_path


def work_through(page: Path, folder: Path) -> list[tuple[str, str]]:
    printed = []
    for what, text in steps(page):
        if isinstance(text, list):
            printed.append((what, run(what, folder)))
            if what.startswith("cd "):
                folder /= what.removeprefix("cd ")
        elif what:
            (folder / what).parent.mkdir(parents=True, exist_ok=True)
            (folder / what).write_text(text, encoding="utf-8")
        else:
            subprocess.run(
                ["patch", "-p1", "--no-backup-if-mismatch"], cwd=folder, input=text, text=True, check=True
            )
    return printed


def run(command: str, folder: Path) -> str:
    """Run a command line, which must succeed, and return its standard output. `mutator` is run by this
    interpreter."""
    bin_folder = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": bin_folder + os.pathsep + os.environ["PATH"]}
    environment.pop("COLUMNS", None)  # pages show piped output
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stderr}"
    return done.stdout


def lines_of(output: str) -> list[str]:
    return [line.rstrip() for line in output.rstrip("\n").splitlines()]


def rewrite(page: Path, printed: list[tuple[str, str]]) -> None:
    rest = iter(printed)

    def session(block: re.Match[str]) -> str:
        commands = [line for line in block[1].splitlines() if line.startswith("$ ")]
        lines = [line for command in commands for line in (command, *lines_of(next(rest)[1]))]
        if page != README:
            lines = [re.sub(DIGEST, "…", line) for line in lines]
        return "```console\n" + "\n".join(lines) + "\n```"

    page.write_text(BLOCK.sub(session, page.read_text(encoding="utf-8")), encoding="utf-8")
    for command, output in printed:
        if page == TUTORIAL and command.startswith(CAMPAIGN):
            lines = lines_of(output.replace("runs/first", "runs/quickstart"))
            before, rest_of_page = README.read_text(encoding="utf-8").split("```text\n", 1)
            after = rest_of_page.split("```", 1)[1]
            README.write_text("\n".join([before + "```text", *lines, "```" + after]), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", WORKED_THROUGH, ids=name)
def test_every_command_of_a_page_prints_what_the_page_says(page: Path, work: Path) -> None:
    found = sessions(page)
    assert len(found) >= 2
    if page in EXAMPLES:
        pytest.importorskip(EXAMPLES[page])
        work = work / page.parent.relative_to(CLONE)
    if any("ssh-keygen" in command for command, _ in found) and not shutil.which("ssh-keygen"):
        pytest.skip("needs ssh-keygen")
    printed = work_through(page, work)
    if os.environ.get("UPDATE_DOCS"):
        rewrite(page, printed)
        pytest.skip("the page was rewritten")
    for (command, output), (_, said) in zip(printed, found, strict=True):
        assert [VARYING.sub("...", line) for line in lines_of(output)] == [
            VARYING.sub("...", line) for line in said
        ], command


@pytest.mark.parametrize(
    "command",
    [
        command
        for page in (README, TUTORIAL)
        for command, _ in sessions(page)
        if re.match(r"mutator (list|diff) [^|]*$", command)
    ],
)
def test_lists_and_diffs_in_the_docs_are_current(
    cli: Cli, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The outputs of README and tutorial are tested here, because they are quick to produce."""
    monkeypatch.setenv("MUTATOR_ROOT", str(CLONE))
    monkeypatch.delenv("COLUMNS")
    said = {command: said for page in (README, TUTORIAL) for command, said in sessions(page)}
    answer = cli(*shlex.split(command)[1:])
    assert (answer.code, lines_of(answer.out)) == (0, said[command])


def test_the_readme_shows_the_table_of_the_tutorial() -> None:
    [table] = TABLE.findall(README.read_text(encoding="utf-8"))
    [shown] = [said for command, said in sessions(TUTORIAL) if command.startswith(CAMPAIGN)]
    lines = table.replace("runs/quickstart", "runs/first").splitlines()
    assert [re.sub(DIGEST, "…", line) for line in lines] == shown


@pytest.mark.parametrize("page", [page for page in PAGES if page not in (README, PAPER_RESULTS)], ids=name)
def test_a_page_shows_no_digest_of_a_run(page: Path) -> None:
    """A digest on a page is soon that of an older tree. README shows one, from the tutorial; the page of the
    paper's campaigns shows those of runs at the commit that it names.
    """
    assert not re.search(rf"\b{DIGEST}\b", page.read_text(encoding="utf-8"))


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as Markdown sites build them. Code fences have no headings."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: Path) -> list[tuple[Path, str]]:
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    return [
        ((page.parent / target).resolve() if target else page, anchor)
        for target, anchor in [*LINK.findall(text), *((image, "") for image in IMAGE.findall(text))]
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_link_is_broken(page: Path) -> None:
    for file, anchor in links(page):
        assert file.exists(), f"{name(page)}: {file}"
        assert not anchor or anchor in anchors(file), f"{name(page)}: {file.name}#{anchor}"


def test_the_index_names_every_page() -> None:
    listed = {file for file, _ in links(INDEX)}
    pages = {page for page in PAGES if INDEX.parent in page.parents and page != INDEX}
    assert pages - listed == set()
    shown = {file for page in PAGES for file, _ in links(page)}
    site = {INDEX.parent / name for name in ("conf.py", "_static", "_templates")}
    rest = {
        file
        for file in INDEX.parent.rglob("*.*")
        if file not in PAGES and file.parent != CLONE / SCHEMAS_FOLDER and not site & {file, *file.parents}
    }
    assert rest - shown == set(), "no page shows or links to these files"


def test_page_names_differ_in_more_than_their_suffix() -> None:
    """The site drops the suffix of a page or notebook."""
    names = [file.with_suffix("") for kind in ("*.md", "*.ipynb") for file in INDEX.parent.rglob(kind)]
    assert len(set(names)) == len(names)


def test_the_guide_has_editor_settings_for_every_schema() -> None:
    page = (HOW_TO / "edit-with-completion.md").read_text(encoding="utf-8")
    [settings] = [json.loads(text) for _, kind, text in FENCE.findall(page) if kind == "json"]
    expected = {
        f"./{SCHEMAS_FOLDER.as_posix()}/{kind.name}.json": kind.files_glob
        for kind in yaml_formats(Workspace.find(root=CLONE).readings())
    }
    expected[f"./{SCHEMAS_FOLDER.as_posix()}/scenario.json"] = "fault_library/scenarios/*.yaml"
    assert settings["yaml.schemas"] == expected


def test_every_benchmark_is_in_the_docs() -> None:
    told = re.findall(r"^\| `(\w+\.py)` ", BENCHMARKS.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(told) == sorted(file.name for file in BENCHMARKS.parent.glob("*.py"))


def test_the_readme_has_both_command_lines() -> None:
    lines = [line for line in README.read_text().splitlines() if line.startswith("python3 -m venv ")]
    assert [("mutator run quickstart" in line, "pytest" in line) for line in lines] == [
        (True, False),
        (False, True),
    ]
    [with_uv] = [line for line in README.read_text().splitlines() if line.startswith("uv venv ")]
    assert with_uv == lines[0].replace("python3 -m venv", "uv venv").replace(".venv/bin/pip", "uv pip")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_that_a_page_only_names_have_all_that_they_need(page: Path) -> None:
    """A command of a `sh` block has every option that it requires, and no other."""
    program = get_command(app)
    assert isinstance(program, TyperGroup)
    for _, kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines() if kind == "sh" else ():
            if line.startswith("mutator ") and "$" not in line:  # the shell gives variables their values
                words = takewhile(
                    lambda word: word not in {"|", ">", "&&"}, shlex.split(line, comments=True)[1:]
                )
                with program.make_context("mutator", list(words)) as context:
                    subcommand, command, rest = program.resolve_command(
                        context, [*context._protected_args, *context.args]
                    )
                    assert command is not None and command.make_context(subcommand, rest, parent=context)
