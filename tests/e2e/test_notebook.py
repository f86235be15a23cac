"""The notebook of the tutorial."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "docs" / "tutorial" / "from-fault-to-comparison.ipynb"


def test_the_notebook_is_kept_without_outputs() -> None:
    """The repository's notebook has no outputs."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) >= 10
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every cell runs, from fault to comparison; plots are images, and all experiments have a result."""
    monkeypatch.setenv("MUTATOR_ROOT", str(NOTEBOOK.parents[2]))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=900, kernel_name="python3").execute(cwd=str(tmp_path))
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 2
    shown = "\n".join(output.get("data", {}).get("text/plain", "") for output in outputs)
    assert "8 of 8 experiments of paper, as_described" in shown
    assert "8 of 8 experiments of paper, as_coded" in shown
    assert not [output for output in outputs if output.get("name") == "stderr"]
