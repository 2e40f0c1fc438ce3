"""The census is a command among others: what it prints may be cut off."""

import os
import subprocess
import sys
from pathlib import Path

CENSUS = Path(__file__).parents[3] / "scripts" / "census.py"


def test_it_ends_without_a_word_when_nobody_reads_on() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, str(CENSUS), "--small"], stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert done.stderr == ""
