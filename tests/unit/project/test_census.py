"""The census is a command among others: what it prints may be cut off."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

CENSUS = Path(__file__).parents[3] / "scripts" / "census.py"


def test_it_ends_without_a_word_when_nobody_reads_on(tmp_path: Path) -> None:
    for folder in ("scripts", "sim"):
        (tmp_path / folder).mkdir()
    shutil.copy(CENSUS, tmp_path / "scripts")
    (tmp_path / "sim" / "small.py").touch()
    (tmp_path / "sim" / "reader.py").write_text("import sim.small")
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, str(tmp_path / "scripts" / "census.py"), "--small"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (-signal.SIGPIPE, "")
