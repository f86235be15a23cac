"""The notebooks of the tutorials."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorial"
COMPARISON = TUTORIALS / "from-fault-to-comparison.ipynb"
RESEARCH = TUTORIALS / "question-to-figure.ipynb"


def run(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, int]:
    monkeypatch.setenv("MUTATOR_ROOT", str(TUTORIALS.parents[1]))
    monkeypatch.setenv("TMPDIR", str(folder))
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=900, kernel_name="python3").execute(cwd=str(folder))
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    plots = [output for output in outputs if "image/png" in output.get("data", {})]
    return "\n".join(output.get("data", {}).get("text/plain", "") for output in outputs), len(plots)


@pytest.mark.parametrize("path", [COMPARISON, RESEARCH], ids=lambda path: path.stem)
def test_notebooks_are_stored_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) >= 10
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)


@pytest.mark.slow
def test_the_comparison_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown, plots = run(COMPARISON, tmp_path, monkeypatch)
    assert plots == 2
    assert "8 of 8 experiments of paper, as_described" in shown
    assert "8 of 8 experiments of paper, as_coded" in shown


@pytest.mark.slow
def test_the_research_notebook_gives_the_answer_of_its_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, plots = run(RESEARCH, tmp_path, monkeypatch)
    assert plots == 2
    page = (TUTORIALS / "tour-researcher.md").read_text(encoding="utf-8")
    [effect] = [line for line in page.splitlines() if line.startswith("difference ")]
    assert f"{effect}: not enough data" in shown
    assert "(True, " in shown
