"""The notebooks of the tutorials are stored with the outputs that they have when they run.

If your change alters an output, write it into the notebooks with
`UPDATE_DOCS=1 pytest -m slow tests/e2e/test_notebook.py`, and read the difference.
"""

import base64
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from PIL import Image

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorial"
COMPARISON = TUTORIALS / "from-fault-to-comparison.ipynb"
RESEARCH = TUTORIALS / "question-to-figure.ipynb"
NOTEBOOKS = pytest.mark.parametrize("path", [COMPARISON, RESEARCH], ids=lambda path: path.stem)

MOST_NOTEBOOK_BYTES = 300_000
PICTURE_WIDTH, PICTURE_COLOURS = 640, 32  # of stored pictures, which are small
RUN_FOLDER = "RUNS"  # stands for the temporary folder of a run
HIDDEN = "…"  # stands for what differs from machine to machine
DURATION = re.compile(
    r"\b\d+ h \d\d min|\b\d+ min(?: \d\d s)?|(?<![.\d@+])\b\d+(?:\.\d+)? s\b(?= each| of CPU| on )"
)
MACHINE_PATH = re.compile(r"(?:/(?:tmp|root|home|opt|work|Users|var)/|[A-Z]:\\)[^\s'\",)<]*")
ESTIMATE = re.compile(r"\b(cpu_s|wall_s)=[\d.]+")
DIGEST = re.compile(r"\b[0-9a-f]{64}\b")  # of a run, so of versions


def code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def executed(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run a notebook in `folder`; return it with outputs as they are stored."""
    monkeypatch.setenv("MUTATOR_ROOT", str(TUTORIALS.parents[1]))
    monkeypatch.setenv("TMPDIR", str(folder))
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=900, kernel_name="python3").execute(cwd=str(folder))
    for number, cell in enumerate(code_cells(notebook), start=1):
        cell.execution_count = number
        cell.metadata = {}
        cell.outputs = [stored_output(output, number, folder) for output in cell.outputs]
    return notebook


def stored_output(output: Any, number: int, folder: Path) -> Any:
    """Return an output without paths and times of this machine, and with a small picture."""
    if "text" in output:
        output.text = hidden(output.text, folder)
    for kind, data in output.get("data", {}).items():
        output.data[kind] = small_picture(data) if kind == "image/png" else hidden(data, folder)
    if "execution_count" in output:
        output.execution_count = number
    return output


def hidden(text: str, folder: Path) -> str:
    text = re.sub(re.escape(str(folder)) + r"/notebook-\w+", RUN_FOLDER, text)
    text = ESTIMATE.sub(rf"\1={HIDDEN}", DURATION.sub(HIDDEN, text))
    return MACHINE_PATH.sub(HIDDEN, text)


def small_picture(data: str) -> str:
    picture = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    if picture.width > PICTURE_WIDTH:
        height = round(picture.height * PICTURE_WIDTH / picture.width)
        picture = picture.resize((PICTURE_WIDTH, height), Image.Resampling.LANCZOS)
    packed = io.BytesIO()
    picture.quantize(PICTURE_COLOURS, dither=Image.Dither.NONE).save(packed, "PNG", optimize=True)
    return base64.b64encode(packed.getvalue()).decode("ascii") + "\n"


def comparable(notebook: Any) -> list[Any]:
    """The outputs without what other versions of packages change: pixels of pictures, and digests of runs."""
    return [
        [
            {
                kind: picture_size(data) if kind == "image/png" else DIGEST.sub("0" * 64, data)
                for kind, data in (output.get("data") or {"text": output.get("text")}).items()
            }
            for output in cell.outputs
        ]
        for cell in code_cells(notebook)
    ]


def picture_size(data: str) -> tuple[int, int]:
    return Image.open(io.BytesIO(base64.b64decode(data))).size


def texts_of(notebook: Any) -> Iterator[str]:
    for cell in code_cells(notebook):
        for output in cell.outputs:
            yield output.get("text", "")
            yield from (data for kind, data in output.get("data", {}).items() if kind != "image/png")


@NOTEBOOKS
def test_notebooks_are_stored_with_outputs_of_no_machine(path: Path) -> None:
    """A reader sees results without running anything, and nothing of the machine that ran it."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = code_cells(notebook)
    assert len(cells) >= 10
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert sum(bool(cell.outputs) for cell in cells) >= len(cells) - 3
    for text in texts_of(notebook):
        assert not MACHINE_PATH.search(text) and not DURATION.search(text), text
    assert not [output for cell in cells for output in cell.outputs if output.get("name") == "stderr"]
    assert path.stat().st_size < MOST_NOTEBOOK_BYTES


@pytest.mark.slow
@NOTEBOOKS
def test_the_outputs_are_those_of_the_code(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise the outputs show what an earlier version did."""
    notebook = executed(path, tmp_path, monkeypatch)
    if os.environ.get("UPDATE_DOCS"):
        nbformat.write(notebook, path)
    assert comparable(nbformat.read(path, as_version=4)) == comparable(notebook)


def test_the_comparison_notebook_compares_both_readings() -> None:
    notebook = nbformat.read(COMPARISON, as_version=4)
    text = "\n".join(texts_of(notebook))
    assert "8 of 8 experiments of paper, as_described" in text
    assert "8 of 8 experiments of paper, as_coded" in text


def test_the_research_notebook_gives_the_answer_of_its_page() -> None:
    text = "\n".join(texts_of(nbformat.read(RESEARCH, as_version=4)))
    page = (TUTORIALS / "tour-researcher.md").read_text(encoding="utf-8")
    [effect] = [line for line in page.splitlines() if line.startswith("difference ")]
    assert f"{effect}: not enough data" in text
    assert "(True, " in text
