"""Bugs that a machine draws: each one changes the program, and is tried by the tests that run its place."""

import ast
import random
import signal

import pytest

from tests.mutants.blocks import blocks_of
from tests.mutants.random_bugs import (
    KEPT,
    LEAST,
    ROOT,
    USAGE,
    Bug,
    Coverage,
    all_bugs,
    interval,
    is_noticed,
    is_where_it_was,
)
from tests.mutants.uses import Uses

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
    coverage = Coverage({"blocks": ["a.py:f.1.0", "a.py:g.1.0"], "tests": tests}, Uses({}))
    bug = Bug("a.py", "f.1.0", 1, 0, 1, "x", "y")
    assert coverage.tests_of(bug, 110.0) == [f"{here}[{n}]" for n in range(2, 21, 2)]
    assert len(coverage.tests_of(bug, 1.0)) == LEAST
    assert coverage.tests_of(bug._replace(block="h.1.0"), 10.0) == []


def test_tests_that_import_the_module_are_tried_first_and_kept_flights_last() -> None:
    near = "tests/unit/project/test_random_bugs.py::test_a_share_has_wilsons_interval"
    far = "tests/unit/project/test_planted_bugs.py::test_every_bug_of_the_list_can_be_planted_and_eight_are_the_sample"
    kept = f"{KEPT}::test_a_flight_comes_to_what_it_came_to_before[aodv]"
    path = "tests/mutants/random_bugs.py"
    coverage = Coverage(
        {"blocks": [f"{path}:f.1.0"], "tests": {far: [1, [0]], near: [9, [0]], kept: [2, [0]]}}, Uses({})
    )
    bug = Bug(path, "f.1.0", 1, 0, 1, "x", "y")
    assert coverage.tests_of(bug, 60.0) == [near, far, kept]


MODULES = {
    "a/b.py": "X = 3\nY = 2 * X\nZ = 1\n\ndef f(x=Z):\n    if x:\n        return X\n    return 0\n",
    "a/__init__.py": "from a.b import *\n",
    "c.py": "import os\nfrom a import Y as other\n\ndef g():\n    for x in other:\n        pass\n",
    "d.py": "from a import b\nclass H:\n    z: int = b.Z\n    def h(self):\n        return self.z\ndef i():\n    H()\n",
}


@pytest.mark.parametrize(
    ("name", "blocks"),
    [
        ("X", {"a/b.py:f.1.1", "c.py:g.1.0"}),
        ("Y", {"c.py:g.1.0"}),
        ("Z", {"a/b.py:f.1.0", "d.py:h.1.0", "d.py:i.1.0"}),
        ("W", set()),
    ],
)
def test_what_uses_a_constant_is_found_through_imports_and_what_is_computed_from_it(
    name: str, blocks: set[str]
) -> None:
    assert Uses(MODULES).blocks("a/b.py", name) == blocks


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


def test_a_constant_is_tried_by_the_tests_that_run_what_uses_it_and_by_those_that_say_it() -> None:
    here = "tests/unit/project/test_random_bugs.py"
    running, saying, other = (f"{here}::{name}" for name in (
        "test_a_block_keeps_its_name_when_its_lines_move", "test_a_share_has_wilsons_interval",
        "test_a_run_of_tests_that_crashes_has_noticed_the_bug"))  # fmt: skip
    uses = Uses({**MODULES, here: "from a.b import Y\n\ndef test_a_share_has_wilsons_interval():\n    assert Y == 6\n"})
    tests = {running: [1, [0]], saying: [2, []], other: [1, [1]]}
    coverage = Coverage({"blocks": ["c.py:g.1.0", "a/b.py:f.1.0"], "tests": tests}, uses)
    bug = Bug("a/b.py", "", 1, 0, 1, "3", "(3 + 1)", constant="X")
    assert coverage.tests_of(bug, 60.0) == [running, saying]
    assert coverage.tests_of(bug._replace(constant="W"), 60.0) == [], "nothing uses it: superfluous"


def test_a_bug_of_a_file_that_has_changed_meanwhile_is_not_judged() -> None:
    bug = next(bug for bug in all_bugs(["bounds"]) if bug.begin > 100)
    assert is_where_it_was(bug)
    assert not is_where_it_was(bug._replace(begin=bug.begin - 1, end=bug.end - 1))
