"""The example notebook does what it says, in a fresh kernel."""

import shutil
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLE = Path(__file__).parents[2] / "examples" / "sweep"


@pytest.mark.filterwarnings("ignore")  # of the kernel's own machinery
def test_the_example_notebook_runs_from_start_to_end(tmp_path: Path) -> None:
    for name in ("relays.toml", "relays.ipynb"):
        shutil.copy(EXAMPLE / name, tmp_path)
    notebook = nbformat.read(tmp_path / "relays.ipynb", as_version=4)
    [choice] = [cell for cell in notebook.cells if cell.source.endswith('seeds, loads = 5, "1,0.2,0.1,0.05"')]
    choice.source = 'import subprocess\nimport sys\n\nseeds, loads = 2, "1,0.1"'
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ()) if "data" in output]
    assert sum("image/png" in output.data for output in shown) == 1
    assert "counter-based" in "".join(output.data.get("text/plain", "") for output in shown)
    assert (tmp_path / "relays-runs" / "runs.parquet").exists()


def test_the_example_notebook_is_kept_without_outputs() -> None:
    notebook = nbformat.read(EXAMPLE / "relays.ipynb", as_version=4)
    assert [cell for cell in notebook.cells if cell.get("outputs") or cell.get("execution_count")] == []
