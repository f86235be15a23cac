"""What README and docs print is what the commands print; what they link exists.

After a change that alters the output, `UPDATE_DOCS=1 pytest -m slow tests/cli/test_docs.py` writes it into
the pages; read the difference before it is kept.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
README = CLONE / "README.md"
BENCHMARKS = CLONE / "benchmarks" / "README.md"
PAGES = [README, BENCHMARKS, *sorted((CLONE / "docs").rglob("*.md"))]
TUTORIAL = CLONE / "docs" / "tutorial" / "first-campaign.md"
COMPARISON = CLONE / "docs" / "how-to" / "compare-with-openpilot.md"

CAMPAIGN = "mutator run quickstart "  # whose table is in both pages
TABLE = re.compile(r"^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]+)(?:#([^)]+))?\)")
# What differs from machine to machine: how long it took.
TIME = re.compile(r"\d+ h \d\d min|\d+ min \d\d s|(?<![.\d])\d+ s\b")


def name(page: Path) -> str:
    return page.relative_to(CLONE).as_posix()


def sessions(page: Path) -> list[tuple[str, list[str]]]:
    """The commands of a page with the lines they are said to print."""
    found: list[tuple[str, list[str]]] = []
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
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
    return tmp_path


def run(command: str, folder: Path) -> str:
    """Standard output of a command line that must be fine; `mutator` is that of this interpreter."""
    bin_folder = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": bin_folder + os.pathsep + os.environ["PATH"]}
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
@pytest.mark.parametrize("page", [README, TUTORIAL, COMPARISON], ids=name)
def test_every_command_of_a_page_prints_what_the_page_says(page: Path, work: Path) -> None:
    """The console sessions of a page, run in its order, give exactly the output that is printed there."""
    found = sessions(page)
    assert len(found) >= (2 if page == COMPARISON else 5)
    printed = [(command, run(command, work)) for command, _ in found]
    if os.environ.get("UPDATE_DOCS"):
        rewrite(page, printed)
        pytest.skip("the page was written anew")
    for (command, output), (_, said) in zip(printed, found, strict=True):
        assert [TIME.sub("TIME", line) for line in lines_of(output)] == [
            TIME.sub("TIME", line) for line in said
        ], command


def test_the_readme_shows_the_table_of_the_tutorial() -> None:
    """README and tutorial run the same campaign, so they show the same numbers."""
    [table] = TABLE.findall(README.read_text(encoding="utf-8"))
    [shown] = [said for command, said in sessions(TUTORIAL) if command.startswith(CAMPAIGN)]
    assert table.splitlines()[:-1] == shown[:-1]  # the last line is the report's path


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    """Each relative link is a file of the clone, each anchor a heading in it."""
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        file = page.parent / target
        assert file.exists(), f"{name(page)}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [heading.lower().replace(" ", "-") for heading in headings]


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
