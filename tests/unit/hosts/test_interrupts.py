"""How a command leaves."""

import subprocess
import sys

LEAVES = """
import atexit, gc
from fanet_mw.hosts import interrupts
atexit.register(lambda: print(len(gc.get_objects()), gc.get_freeze_count()))
interrupts.leave(7)
"""


def test_a_command_leaves_with_its_code_and_without_a_last_collection_over_all_that_is_imported() -> None:
    done = subprocess.run([sys.executable, "-c", LEAVES], capture_output=True, text=True, check=False)
    left, frozen = map(int, done.stdout.split())
    assert done.returncode == 7
    assert frozen > 100 * max(left, 10)
