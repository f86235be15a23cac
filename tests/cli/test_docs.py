"""What README and docs print is what the commands print; what they link exists.

A page is worked through as a reader would: its commands are given in its order, a block that follows a line
with the name of a file (`` `late.yaml`: ``) is written to that file, one with a difference is applied.
After a change that alters the output, `UPDATE_DOCS=1 pytest -m slow tests/cli/test_docs.py` writes it into
the pages; read the difference before it is kept.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.reference.pages import SCHEMAS
from mutator.reference.schemas import file_formats
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
PAGES += [CLONE / "examples" / "README.md", *EXAMPLES]
TUTORIAL = CLONE / "docs" / "tutorial" / "first-campaign.md"
HOW_TO = CLONE / "docs" / "how-to"
COMPARISON = HOW_TO / "compare-with-openpilot.md"
WORKED_THROUGH = [
    README,
    TUTORIAL,
    TUTORIAL.with_name("first-fault.md"),
    TUTORIAL.with_name("your-own-controller.md"),
    TUTORIAL.with_name("tour-safety-engineer.md"),
    TUTORIAL.with_name("tour-controller-developer.md"),
    COMPARISON,
    *sorted(set(HOW_TO.glob("add-a-*.md")) - {HOW_TO / "add-a-study.md"}),  # whose code test_studies runs
    *EXAMPLES,
]
INDEX = CLONE / "docs" / "README.md"

Cli = Callable[..., Any]  # runs `mutator WORDS...`, gives code, out, err, json
CAMPAIGN = "mutator run quickstart "  # whose table is in both pages
TABLE = re.compile(r"^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"(?:^([^\n]*)\n\n)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"`([^`\s]+)`[^`]*:$")
# Also `[text]: page.md`, and images; not what is on the web.
LINK = re.compile(r"\]\(([^)#:\s]*)(?:#([^)\s]+))?\)")
IMAGE = re.compile(r"""<(?:img|source) [^>]*\bsrc(?:set)?="([^"#:\s]+)\"""")
# What differs from machine to machine: how long it took, and the seal, in which are all versions.
VARYING = re.compile(
    r"\d+ h \d\d min|\d+ min \d\d s|(?<![.\d])\d+ s\b|\d\.\d s each|(?<=^seal: )[0-9a-f]{64}$"
)


# A package called mutator on an index is not this project.
BY_NAME = re.compile(r"\b(?:pip|pipx|uv)\b[^\n`]*\b(?:install|add)\b[^\n`]*(?<![\w/.-])mutator(?![\w/.*-])")


def name(page: Path) -> str:
    return page.relative_to(CLONE).as_posix()


def sessions(page: Path) -> list[tuple[str, list[str]]]:
    """The commands of a page with the lines they are said to print."""
    return [step for step in steps(page) if isinstance(step[1], list)]  # type: ignore[misc]


def steps(page: Path) -> list[tuple[str, list[str] | str]]:
    """What a reader does, in order: (command, lines it prints), (file, its text) or ("", a difference)."""
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
    """A folder with what the commands of the docs need of a clone."""
    for folder in ("fault_library", "templates", "target"):
        shutil.copytree(CLONE / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for toy in (Path("tests") / "toy", Path("tests") / "pole"):
        shutil.copytree(CLONE / toy, tmp_path / toy, ignore=shutil.ignore_patterns("__pycache__"))
    examples = CLONE / "examples"
    shutil.copytree(examples, tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__", "runs"))
    return tmp_path


def work_through(page: Path, folder: Path) -> list[tuple[str, str]]:
    """Do in `folder` what the page says; gives the commands with what they printed."""
    printed = []
    for what, text in steps(page):
        if isinstance(text, list):
            printed.append((what, run(what, folder)))
        elif what:
            (folder / what).parent.mkdir(parents=True, exist_ok=True)
            (folder / what).write_text(text, encoding="utf-8")
        else:
            subprocess.run(
                ["patch", "-p1", "--no-backup-if-mismatch"], cwd=folder, input=text, text=True, check=True
            )
    return printed


def run(command: str, folder: Path) -> str:
    """Standard output of a command line that must be fine; `mutator` is that of this interpreter."""
    bin_folder = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": bin_folder + os.pathsep + os.environ["PATH"]}
    environment.pop("COLUMNS", None)  # a page shows what a pipe gets
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stderr}"
    return done.stdout


def lines_of(output: str) -> list[str]:
    """Lines as a page prints them: without trailing blanks."""
    return [line.rstrip() for line in output.rstrip("\n").splitlines()]


def rewrite(page: Path, printed: list[tuple[str, str]]) -> None:
    """Put what the commands printed into the page, and the tutorial's table into the README."""
    rest = iter(printed)

    def session(block: re.Match[str]) -> str:
        commands = [line for line in block[1].splitlines() if line.startswith("$ ")]
        lines = [line for command in commands for line in (command, *lines_of(next(rest)[1]))]
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
    """The console sessions of a page, run in its order, give exactly the output that is printed there."""
    found = sessions(page)
    assert len(found) >= 2
    if page in EXAMPLES:
        pytest.importorskip(EXAMPLES[page])
        work = work / page.parent.relative_to(CLONE)
    printed = work_through(page, work)
    if os.environ.get("UPDATE_DOCS"):
        rewrite(page, printed)
        pytest.skip("the page was written anew")
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
def test_what_costs_little_is_always_tried(cli: Cli, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists and diffs in README and tutorial are those of the library and target as they are."""
    monkeypatch.setenv("MUTATOR_ROOT", str(CLONE))
    monkeypatch.delenv("COLUMNS")
    said = {command: said for page in (README, TUTORIAL) for command, said in sessions(page)}
    answer = cli(*shlex.split(command)[1:])
    assert (answer.code, lines_of(answer.out)) == (0, said[command])


def test_the_readme_shows_the_table_of_the_tutorial() -> None:
    """README and tutorial run the same campaign, so they show the same numbers."""
    [table] = TABLE.findall(README.read_text(encoding="utf-8"))
    [shown] = [said for command, said in sessions(TUTORIAL) if command.startswith(CAMPAIGN)]
    assert table.replace("runs/quickstart", "runs/first").splitlines() == shown


def anchors(page: Path) -> set[str]:
    """Names of a page's headings, as the web sites that show Markdown make them; fences are no headings."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: Path) -> list[tuple[Path, str]]:
    """Files that a page links, with anchors; its own anchors, too."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    return [
        ((page.parent / target).resolve() if target else page, anchor)
        for target, anchor in [*LINK.findall(text), *((image, "") for image in IMAGE.findall(text))]
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    """Each relative link is a file of the clone, each anchor a heading in it."""
    for file, anchor in links(page):
        assert file.exists(), f"{name(page)}: {file}"
        assert not anchor or anchor in anchors(file), f"{name(page)}: {file.name}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_nobody_is_told_to_install_by_name(page: Path) -> None:
    """On an index the name is somebody else's project, so pages install from a clone or from a file."""
    assert not BY_NAME.search(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("command", ["pip install mutator", "pip install 'mutator[dev]'", "uv add mutator"])
def test_installing_by_name_would_be_noticed(command: str) -> None:
    """The pattern finds such commands, and lets those pass that name a folder or a file."""
    assert BY_NAME.search(command)
    assert not BY_NAME.search("pip install dist/mutator-0.1.0.whl && .venv/bin/mutator list")


def test_every_page_can_be_reached() -> None:
    """The index of the documentation names every page, but for what belongs to one that it names."""
    listed = {file for file, _ in links(INDEX)}
    pages = {page for page in PAGES if INDEX.parent in page.parents and page != INDEX}
    assert pages - listed == set()
    shown = {file for page in PAGES for file, _ in links(page)}
    site = {INDEX.parent / name for name in ("conf.py", "_static", "_templates")}
    rest = {
        file
        for file in INDEX.parent.rglob("*.*")
        if file not in PAGES and file.parent != CLONE / SCHEMAS and not site & {file, *file.parents}
    }
    assert rest - shown == set(), "no page shows or links these"


def test_editors_are_told_of_every_schema() -> None:
    """The settings that the guide prints map each schema to the files that it is made for."""
    page = (HOW_TO / "edit-with-completion.md").read_text(encoding="utf-8")
    [settings] = [json.loads(text) for _, kind, text in FENCE.findall(page) if kind == "json"]
    expected = {
        f"./{SCHEMAS.as_posix()}/{kind.name}.json": kind.files
        for kind in file_formats(Workspace.find(root=CLONE).readings())
    }
    expected[f"./{SCHEMAS.as_posix()}/scenario.json"] = "fault_library/scenarios/*.yaml"
    assert settings["yaml.schemas"] == expected


def test_every_benchmark_is_told_of() -> None:
    """The table of benchmarks has a line for each, and for nothing that is not there."""
    told = re.findall(r"^\| `(\w+\.py)` ", BENCHMARKS.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(told) == sorted(file.name for file in BENCHMARKS.parent.glob("*.py"))


def test_the_readme_has_both_command_lines() -> None:
    """Installing and running, installing and testing: one line each, to be copied."""
    lines = [line for line in README.read_text().splitlines() if line.startswith("python3 -m venv ")]
    assert [("mutator run quickstart" in line, "pytest" in line) for line in lines] == [
        (True, False),
        (False, True),
    ]
