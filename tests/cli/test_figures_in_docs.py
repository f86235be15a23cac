"""Figures in the docs name the command that makes them, and cheap ones are compared with what it prints."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
EXPLANATION = CLONE / "docs" / "explanation"
with (EXPLANATION / "figures.csv").open(encoding="utf-8", newline="") as file:
    FIGURES = list(csv.DictReader(file))
NUMBER = re.compile(r"[-+]?\d+\.\d+")


@pytest.mark.parametrize("row", FIGURES, ids=lambda row: f"{row['page']}: {row['figure']}")
def test_a_figure_has_a_page_and_either_a_test_or_a_commit(row: dict[str, str]) -> None:
    assert (CLONE / row["page"]).is_file() and row["figure"] and row["command"]
    assert bool(row["compared by"]) != bool(re.fullmatch("[0-9a-f]{7,40}", row["commit"]))
    assert not row["compared by"] or (CLONE / row["compared by"]).is_file()
    if script := re.match(r"python (benchmarks/\w+\.py)", row["command"]):
        assert (CLONE / script[1]).is_file()


def test_pages_that_show_what_a_benchmark_prints_are_listed() -> None:
    """Apart from that of speed, whose figures depend on the machine."""
    listed = {row["page"] for row in FIGURES}
    for page in sorted(EXPLANATION.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if page.name not in ("performance.md", "statistics.md", "figures.md", "engines.md"):
            is_shown = re.search(r"`(PYTHONPATH=target )?python benchmarks/\w+\.py", text)
            assert not is_shown or page.relative_to(CLONE).as_posix() in listed, page.name


def printed(script: str) -> str:
    environment = {"PYTHONPATH": str(CLONE / "target"), "PATH": "/usr/bin:/bin"}
    command = [sys.executable, f"benchmarks/{script}"]
    done = subprocess.run(command, cwd=CLONE, env=environment, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.slow
def test_the_page_lists_the_speed_glitches_as_the_benchmark_prints_them() -> None:
    page = (EXPLANATION / "speed-glitch.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    [block] = [text for text in blocks if "mended" in text]
    assert [line.split() for line in block.splitlines()] == [
        line.split() for line in printed("glitch.py").splitlines()
    ]


@pytest.mark.slow
def test_the_page_has_the_offsets_that_the_benchmark_prints() -> None:
    """Without the sign, which the page leaves out; `-` is 0."""
    page = (EXPLANATION / "lateral-dynamics.md").read_text(encoding="utf-8")
    table = page.split("| case |", 1)[1].split("\n\n", 1)[0].splitlines()[2:]
    for shown, line in zip(table, printed("lateral.py").splitlines()[1:], strict=True):
        cells = [NUMBER.findall(cell) for cell in shown.split("|")[2:-1]]
        numbers = NUMBER.findall(line.split("  ", 1)[1])
        assert [float(found[0]) if found else 0.0 for found in cells] == [abs(float(n)) for n in numbers]
