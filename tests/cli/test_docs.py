"""What README and docs print is what the commands print; what they link exists."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PAGES = [CLONE / "README.md", *sorted((CLONE / "docs").rglob("*.md"))]
TUTORIAL = CLONE / "docs" / "tutorial" / "first-campaign.md"

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


def told(text: str) -> list[str]:
    return [TIME.sub("TIME", line.rstrip()) for line in text.rstrip("\n").splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("page", [CLONE / "README.md", TUTORIAL], ids=name)
def test_every_command_of_a_page_prints_what_the_page_says(page: Path, work: Path) -> None:
    """The console sessions of a page, run in its order, give exactly the output that is printed there."""
    found = sessions(page)
    assert len(found) >= 5
    for command, said in found:
        assert told(run(command, work)) == [TIME.sub("TIME", line) for line in said], command


def test_the_readme_shows_the_table_of_the_tutorial() -> None:
    """README and tutorial run the same campaign, so they show the same numbers."""
    [table] = re.findall(r"^```text\n(.*?)^```$", PAGES[0].read_text(), re.MULTILINE | re.DOTALL)
    [shown] = [said for command, said in sessions(TUTORIAL) if command.startswith("mutator run quickstart ")]
    assert told(table)[:-1] == [TIME.sub("TIME", line) for line in shown][:-1]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    """Each relative link is a file of the clone, each anchor a heading in it."""
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        file = page.parent / target
        assert file.exists(), f"{name(page)}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [heading.lower().replace(" ", "-") for heading in headings]


def test_the_readme_has_both_command_lines() -> None:
    """Installing and running, installing and testing: one line each, to be copied."""
    lines = [line for line in PAGES[0].read_text().splitlines() if line.startswith("python3 -m venv ")]
    assert [("mutator run quickstart" in line, "pytest" in line) for line in lines] == [
        (True, False),
        (False, True),
    ]
