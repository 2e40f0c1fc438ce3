"""The example notebook does what it says: its cells as one program, and in a fresh kernel in the long run."""

import shutil
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLE = Path(__file__).parents[2] / "examples" / "sweep"


def shortened(folder: Path) -> nbformat.NotebookNode:
    """The notebook in a folder with its sweep, with fewer runs of lighter loads."""
    for name in ("relays.toml", "relays.ipynb"):
        shutil.copy(EXAMPLE / name, folder)
    notebook = nbformat.read(folder / "relays.ipynb", as_version=4)
    [choice] = [cell for cell in notebook.cells if cell.source.endswith('seeds, loads = 5, "1,0.2,0.1,0.05"')]
    choice.source = 'import subprocess\nimport sys\n\nseeds, loads = 2, "1,0.5"'
    return notebook


@pytest.mark.slow
def test_the_cells_of_the_example_notebook_compare_two_relays_and_draw_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    names: dict[str, object] = {}
    for cell in shortened(tmp_path).cells:
        if cell.cell_type == "code":
            exec(compile(cell.source, "relays.ipynb", "exec"), names)
    assert list(names["found"]["mean"]) == ["all relay", "counter-based"]  # type: ignore[index]
    assert len(names["axes"].containers) == 2  # type: ignore[attr-defined]
    assert names["both"].shape == (4, 2)  # type: ignore[attr-defined]
    assert (tmp_path / "relays-runs" / "runs.parquet").exists()
    plt.close("all")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the kernel's own machinery
def test_the_example_notebook_runs_from_start_to_end(tmp_path: Path) -> None:
    notebook = shortened(tmp_path)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", ()) if "data" in output]
    assert sum("image/png" in output.data for output in shown) == 1
    assert "counter-based" in "".join(output.data.get("text/plain", "") for output in shown)
    assert (tmp_path / "relays-runs" / "runs.parquet").exists()


def test_the_example_notebook_is_kept_without_outputs() -> None:
    notebook = nbformat.read(EXAMPLE / "relays.ipynb", as_version=4)
    assert [cell for cell in notebook.cells if cell.get("outputs") or cell.get("execution_count")] == []
