"""Full disks, kills and too little address space, at fewer places than `broken_runs.py` by itself."""

import subprocess
import sys
from pathlib import Path

import broken_runs
import pytest

SCRIPT = Path(broken_runs.__file__)
MAY_MOUNT = subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode == 0


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "words",
    [
        pytest.param("disk 7", marks=pytest.mark.skipif(not MAY_MOUNT, reason="no file system can be mounted here")),
        pytest.param(
            "disk 3 launch",
            marks=pytest.mark.skipif(not MAY_MOUNT, reason="no file system can be mounted here"),
        ),
        "kills 8",
        "kills 3 launch",
        "memory 400 900 125",
    ],
)
def test_no_run_that_is_cut_seems_whole(words: str) -> None:
    done = subprocess.run([sys.executable, SCRIPT, *words.split()], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "kept" in done.stdout


def test_what_is_cut_or_rough_is_noticed(tmp_path: Path) -> None:
    assert broken_runs.cut(tmp_path) == ["summary.json"]
    (tmp_path / "summary.json").write_text('{"valid": true, "files": {"trace.jsonl": {"bytes": 3, "sha256": "0"}}}')
    (tmp_path / "trace.jsonl").write_text("abc")
    assert broken_runs.cut(tmp_path) == ["trace.jsonl"]
    assert broken_runs.says_valid(tmp_path)
    assert broken_runs.Ended(1, "", "Traceback (most recent call last):").rough() == ["a traceback"]
    assert broken_runs.Ended(-11, "", "").rough() == ["it ended without a word", "signal 11"]
    assert broken_runs.Ended(2, "", "one line\n").rough() == []
