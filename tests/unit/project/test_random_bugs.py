"""Bugs that a machine draws: each one changes the program, and is tried by the tests that run its place."""

import ast
import random
import signal

import pytest

from tests.mutants.blocks import blocks_of
from tests.mutants.random_bugs import LEAST, ROOT, USAGE, Bug, Coverage, all_bugs, interval, is_noticed

SOURCE = """
def first(x):
    if x:
        return 1
    return 2

def second(x):
    for y in x:
        yield y
"""


@pytest.mark.slow
def test_each_bug_is_another_program() -> None:
    for bug in random.Random(1).sample(all_bugs(["bounds", "world"]), 60):
        source = (ROOT / bug.path).read_text(encoding="utf-8")
        assert source[bug.begin : bug.end] == bug.old
        changed = source[: bug.begin] + bug.new + source[bug.end :]
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))


def test_a_block_keeps_its_name_when_its_lines_move() -> None:
    names = [name for name, _ in blocks_of(ast.parse(SOURCE))]
    assert names == ["first.1.0", "first.1.1", "second.1.0", "second.1.1"]
    assert [name for name, _ in blocks_of(ast.parse("import os\n\n" + SOURCE))] == names


def test_the_shortest_tests_that_run_a_block_try_its_bugs_until_the_budget_is_spent() -> None:
    here = "tests/unit/project/test_random_bugs.py::test_a_block_keeps_its_name_when_its_lines_move"
    tests = {f"{here}[{n}]": [n, [n % 2]] for n in range(1, 31)}
    coverage = Coverage({"blocks": ["a.py:f.1.0", "a.py:g.1.0"], "tests": tests})
    bug = Bug("a.py", "f.1.0", 1, 0, 1, "x", "y")
    assert coverage.tests_of(bug, 110.0) == [f"{here}[{n}]" for n in range(2, 21, 2)]
    assert len(coverage.tests_of(bug, 1.0)) == LEAST
    assert coverage.tests_of(bug._replace(block=""), 10.0)[0] == f"{here}[1]", "a constant: all of its file"
    assert coverage.tests_of(bug._replace(block="h.1.0"), 10.0) == []


def test_a_run_of_tests_that_crashes_has_noticed_the_bug() -> None:
    assert is_noticed(-signal.SIGSEGV, "")
    assert is_noticed(1, "1 failed")
    assert is_noticed(USAGE, "ImportError while loading conftest")
    assert not is_noticed(0, "1 passed")
    assert not is_noticed(-signal.SIGKILL, ""), "somebody else has ended it"
    assert not is_noticed(USAGE, "no such test")


def test_a_share_has_wilsons_interval() -> None:
    assert [round(end, 3) for end in interval(29, 34)] == [0.699, 0.936]
    assert interval(0, 0) == (0.0, 1.0)
