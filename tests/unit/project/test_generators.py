"""Whatever a generator says of the source it says of the tree in which it stands, in a second worktree too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
GENERATORS = sorted((ROOT / "scripts").glob("generate_*.py"))


@pytest.mark.parametrize("script", GENERATORS, ids=lambda script: script.stem)
def test_a_generator_reads_the_tree_beside_it(script: Path, tmp_path: Path) -> None:
    for package in ("fanet_mw", "agents", "emulator", "sim"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text(f"raise ImportError('{package} of another tree')")
    done = subprocess.run(
        [sys.executable, str(script), "--no-such-flag"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, "of another tree" in done.stderr) == (2, False)
