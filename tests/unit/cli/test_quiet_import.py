"""Importing the packages prints nothing."""

import subprocess
import sys


def test_the_world_is_imported_in_silence() -> None:
    command = [sys.executable, "-c", "import sim.world.engines.pybullet, sys; sys.stderr.write('and this is said')"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == ("", "and this is said")
