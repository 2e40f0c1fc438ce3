"""Bugs that a machine draws: places and operators by chance, the tests that run the place, and the share that notices.

    a block of the product, drawn by the number of its changes  ->  one change of it  ->  planted in memory
    ->  the tests that run that block, the nearest first, then the kept flights  ->  caught | survived | never run

A constant of a module is tried by the tests that run what uses it (`uses.py`). What crashes the interpreter is caught,
and so is what takes longer than half a minute and eight times as long as without a bug.

Which tests run which block is measured once (`blocks.py`) and kept in `tests/mutants/blocks.json` until it is asked
for anew; where numba compiles, in `uncompiled.json`: bugs are planted there in the uncompiled code, and tried by the
tests of the emulator and the kept flights.
What changes nothing that anybody could observe is named in `equivalent.toml`, each with its reason.
"""

import argparse
import ast
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parents[1]
sys.path.insert(0, str(ROOT))
from tests.mutants.blocks import AREAS, PACKAGES, area_of, blocks_of, is_compiled  # noqa: E402
from tests.mutants.uses import Uses, module_of  # noqa: E402

MAP: Final = HERE / "blocks.json"
UNCOMPILED_MAP: Final = HERE / "uncompiled.json"
EQUIVALENT: Final = HERE / "equivalent.toml"
BUDGET_S: Final = 60.0
"""The most processor time of the tests for one bug, but for kept flights; at least `LEAST` of them."""
LEAST: Final = 8
_SLOW: Final = 30.0, 8.0
"""A test may take this time, and so many times what it took when the map was made; all tests of one bug the same."""
KEPT: Final = "tests/integration/test_kept_flights.py"
"""What notices any change of what a swarm does: tried when nothing nearer has noticed."""
USAGE: Final = 4
"""The exit code of pytest for a test that is not there."""
BY_FLIGHT: Final = "caught by a kept flight"
_CRASHES: Final = (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT)
"""The signals that a process gets for what it has done itself."""
OF_COMPILED: Final = ("tests/unit/emulator", "tests/integration/test_medium_fuzz.py", KEPT)
_COMPARED: Final = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
                    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in"}  # fmt: skip
_COMPUTED: Final = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "*",
                    ast.LShift: ">>", ast.RShift: "<<", ast.BitAnd: "|", ast.BitOr: "&"}  # fmt: skip
_NOT_LOGIC: Final = (ast.Assert, ast.Raise, ast.Import, ast.ImportFrom, ast.FunctionDef, ast.AsyncFunctionDef,
                     ast.ClassDef)  # fmt: skip
_COMPILED_ONLY: Final = ("emulator/kernel/jit.py", "emulator/kernel/entry.py")
"""Files whose code runs only where numba compiles: no bugs of the uncompiled code are drawn of them."""
_LOOKS: Final = ("strict", "linewidth", "zorder", "alpha", "fontsize", "markersize")
"""Parameters that assert, and those of pictures, of which people's eyes judge."""
_TOLD: Final = ("__repr__", "__str__", "describe", "sentence", "report")
"""Functions for people's eyes, of which no bugs are drawn."""


class Bug(NamedTuple):
    """One change of one place."""

    path: str
    block: str
    """The name of its block; empty for a constant of a module or class."""
    line: int
    begin: int
    end: int
    old: str
    new: str
    inside: str = ""
    """The line in which it stands."""
    constant: str = ""
    """Its name, for a constant."""

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {' '.join(self.old.split())[:60]}  ->  {' '.join(self.new.split())[:60]}"

    @property
    def key(self) -> str:
        """By what it is known in `equivalent.toml`."""
        return f"{self.path}: {self.inside}: {' '.join(self.old.split())} -> {' '.join(self.new.split())}"


class Source:
    """One file, and the text of its nodes."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.text = (ROOT / path).read_text(encoding="utf-8")
        self._starts = [0]
        for line in self.text.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._lines = self.text.splitlines()

    def _at(self, line: int, column: int) -> int:
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def span(self, node: Any) -> tuple[int, int]:
        return self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)

    def of(self, node: Any) -> str:
        begin, end = self.span(node)
        return self.text[begin:end]

    def bug(self, block: str, node: Any, new: str) -> Bug:
        begin, end = self.span(node)
        line = self._lines[node.lineno - 1].strip()
        return Bug(self.path, block, node.lineno, begin, end, self.text[begin:end], new, line)

    def bugs(self) -> Iterator[Bug]:
        """Every change that the operators know, in the functions of the file and in its constants."""
        tree = ast.parse(self.text)
        told = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name in _TOLD]
        hidden = {id(inner) for node in told for inner in ast.walk(node)}
        for block, body in blocks_of(tree):
            for statement in body:
                if id(statement) not in hidden and not isinstance(statement, _NOT_LOGIC):
                    yield from self._of_statement(block, statement)
        for node in tree.body:
            if isinstance(node, ast.AnnAssign) and node.value is not None:  # others name types
                yield from (bug._replace(constant=self.of(node.target)) for bug in self._of_expression("", node.value))

    def _of_statement(self, block: str, statement: ast.stmt) -> Iterator[Bug]:
        match statement:
            case ast.If(test=test) | ast.While(test=test):
                yield self.bug(block, test, f"not ({self.of(test)})")
                yield from self._of_expression(block, test)
            case ast.Expr(value=ast.Call() as call):
                yield self.bug(block, statement, "pass")
                yield from self._of_expression(block, call)
            case ast.AugAssign(value=value, op=op):
                yield self.bug(block, statement, "pass")
                if type(op) in _COMPUTED:
                    target = self.of(statement.target)
                    yield self.bug(block, statement, f"{target} {_COMPUTED[type(op)]}= {self.of(value)}")
                yield from self._of_expression(block, value)
            case ast.Continue():
                yield self.bug(block, statement, "break")
            case ast.Assign(value=value) | ast.AnnAssign(value=value) | ast.Return(value=value) if value is not None:
                yield from self._of_expression(block, value)
            case ast.For(iter=iterated):
                yield from self._of_expression(block, iterated)
            case _:
                return

    def _of_expression(self, block: str, expression: ast.expr) -> Iterator[Bug]:
        told = [
            node
            for node in ast.walk(expression)
            if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.keyword) and node.arg in _LOOKS)
        ]
        left_out = {id(inner) for node in told for inner in ast.walk(node)}
        for node in ast.walk(expression):
            if id(node) in left_out:
                continue
            match node:
                case ast.Compare(left=left, ops=[op], comparators=[right]):
                    yield self.bug(block, node, f"{self.of(left)} {_COMPARED[type(op)]} {self.of(right)}")
                case ast.BinOp(left=left, op=op, right=right) if type(op) in _COMPUTED and not _is_text(node):
                    yield self.bug(block, node, f"({self.of(left)}) {_COMPUTED[type(op)]} ({self.of(right)})")
                case ast.BoolOp(op=op, values=values):
                    word = " or " if isinstance(op, ast.And) else " and "
                    yield self.bug(block, node, word.join(f"({self.of(value)})" for value in values))
                    yield self.bug(block, node, f"({self.of(values[0])})")
                case ast.UnaryOp(op=ast.Not(), operand=operand):
                    yield self.bug(block, node, f"bool({self.of(operand)})")
                case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
                    yield self.bug(block, node, f"({self.of(operand)})")
                case ast.Constant(value=bool() as value):
                    yield self.bug(block, node, str(not value))
                case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                    yield self.bug(block, node, f"({self.of(node)} {'+ 1' if abs(value) < 10 else '* 2'})")
                case ast.Call(func=ast.Name(id="min" | "max" as name), args=[first, _, *_]) if not isinstance(
                    first, ast.Starred
                ):
                    other = "max" if name == "min" else "min"
                    yield self.bug(block, node, other + self.of(node)[len(name) :])
                    yield self.bug(block, node, f"({self.of(first)})")
                case ast.IfExp(test=test, body=body, orelse=orelse):
                    yield self.bug(block, node, f"({self.of(body)} if not ({self.of(test)}) else {self.of(orelse)})")
                case ast.Call(func=ast.Name(id="abs" | "round" | "sorted" | "reversed"), args=[first], keywords=[]):
                    yield self.bug(block, node, f"({self.of(first)})")
                case _:
                    pass


def _is_text(node: ast.BinOp) -> bool:
    return any(isinstance(part, ast.JoinedStr | ast.Constant) and not isinstance(getattr(part, "value", 0), int | float)
               for part in (node.left, node.right))  # fmt: skip


def all_bugs(areas: Sequence[str]) -> list[Bug]:
    """Every bug of some areas."""
    found = []
    for folder in PACKAGES:
        for file in sorted((ROOT / folder).rglob("*.py")):
            path = file.relative_to(ROOT).as_posix()
            if area_of(path) in areas and path not in _COMPILED_ONLY:
                found += Source(path).bugs()
    return found


class Coverage:
    """Which tests run which blocks, as `blocks.py` has noted it."""

    def __init__(self, known: Any, uses: Uses) -> None:
        self._uses = uses
        self._took_s: dict[str, float] = {name: took_s for name, (took_s, _) in known["tests"].items()}
        self._tests: dict[str, list[str]] = {name: [] for name in known["blocks"]}
        for test, (_, blocks) in known["tests"].items():
            for block in blocks:
                self._tests[known["blocks"][block]].append(test)

    def tests_of(self, bug: Bug, budget_s: float) -> list[str]:
        """The tests that run a block, or what uses a constant: those whose file imports the bug's module first, then
        the shortest, within a budget of processor time; at last the kept flights.
        """
        running = self._running(bug)
        flights = {test for test in running if test.startswith(KEPT)}
        near = self._within(budget_s, running - flights, bug.path)
        return near + sorted(flights, key=self._took_s.__getitem__)

    def _running(self, bug: Bug) -> set[str]:
        keys, tests = {f"{bug.path}:{bug.block}"}, set[str]()
        if not bug.block:
            keys = self._uses.blocks(bug.path, bug.constant)
            tests = {test for test in self._took_s if f"{_function_of(test)}.1.0" in keys}  # those that say it
            if not tests and not keys & self._tests.keys():  # used where no blocks are noted
                paths = {key.partition(":")[0] for key in keys}
                tests = {
                    test for test in self._took_s if _is_there(test) and any(_is_near(test, path) for path in paths)
                }
        return {test for test in tests.union(*(self._tests.get(key, ()) for key in keys)) if _is_there(test)}

    def _within(self, budget_s: float, tests: set[str], path: str) -> list[str]:
        chosen, spent_s = list[str](), 0.0
        for name in sorted(tests, key=lambda test: (not _is_near(test, path), self._took_s[test], test)):
            spent_s += self._took_s[name]
            if spent_s > budget_s and len(chosen) >= LEAST:
                break
            chosen.append(name)
        return chosen

    def limits_s(self, tests: Sequence[str]) -> tuple[float, float]:
        """After this time one of some tests, or all of them, have not only been slow, but hang."""
        took_s = [self._took_s[test] for test in tests]
        return _SLOW[0] + _SLOW[1] * max(took_s), _SLOW[0] + _SLOW[1] * sum(took_s)


class Judge:
    """Says of bugs what the tests say."""

    def __init__(self, compiled: Coverage, uncompiled: Coverage, *, budget_s: float) -> None:
        self._coverage, self._uncompiled = compiled, uncompiled
        self._budget_s = budget_s

    def verdict(self, bug: Bug) -> tuple[str, float]:
        """`caught`, `survived`, `never run`, or why it cannot be said; and the time."""
        began_s = time.monotonic()
        uncompiled = is_compiled((ROOT / bug.path).read_text(encoding="utf-8"), bug.path)
        coverage = self._uncompiled if uncompiled else self._coverage
        tests = coverage.tests_of(bug, self._budget_s)
        if not tests:
            return "never run", 0.0
        verdict = self._verdict(bug, tests, limits_s=coverage.limits_s(tests), uncompiled=uncompiled)
        if not is_where_it_was(bug):
            verdict = "not judged: the file has changed since"
        return verdict, time.monotonic() - began_s

    def _verdict(self, bug: Bug, tests: Sequence[str], *, limits_s: tuple[float, float], uncompiled: bool) -> str:
        change = json.dumps({"module": module_of(bug.path), "begin": bug.begin, "end": bug.end, "new": bug.new})
        environment = {**os.environ, "FANET_MUTANT": change, "PYTHONPATH": str(HERE / "hook")}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"
        if uncompiled:
            environment["FANET_NO_NUMBA"] = "1"
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", "-p", "no:cacheprovider"]
        # an exception in a loop without end would only end the test if nothing catches it
        command += [f"--timeout={limits_s[0]:.0f}", "--timeout-method=thread"]
        # pytest would load what it rewrites itself
        command += ["--hypothesis-profile=mutants", "--assert=plain", *tests]
        child = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            start_new_session=True, text=True,
        )  # fmt: skip
        try:
            said, _ = child.communicate(timeout=limits_s[1])
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            child.communicate()
            return "caught"
        if child.returncode == 0:
            return "survived"
        if child.returncode == USAGE and any("[" in test for test in tests):  # parameters have changed since
            whole = sorted({test.partition("[")[0] for test in tests})
            return self._verdict(bug, whole, limits_s=limits_s, uncompiled=uncompiled)
        if not is_noticed(child.returncode, said):
            return f"not judged: {said[-300:]}"
        return BY_FLIGHT if f"FAILED {KEPT}" in said else "caught"


def is_where_it_was(bug: Bug) -> bool:
    """False if the file of a bug has changed meanwhile, so that it was planted elsewhere."""
    return (ROOT / bug.path).read_text(encoding="utf-8")[bug.begin : bug.end] == bug.old


def is_noticed(returncode: int, said: str) -> bool:
    """True for a run of tests that has failed, could not begin, or has crashed, as compiled code with a bug may."""
    return (
        -returncode in _CRASHES
        or returncode in (1, 2)
        or any(text in said for text in ("ERROR collecting", "ImportError", "conftest"))
    )


def _function_of(test: str) -> str:
    """The function of a test as `uses.py` names it."""
    file, _, name = test.partition("::")
    return f"{file}:{name.rpartition('::')[2].partition('[')[0]}"


def all_uses() -> Uses:
    """The uses of what the product's modules and the tests define."""
    files = (file for folder in (*PACKAGES, "tests") for file in sorted((ROOT / folder).rglob("*.py")))
    return Uses({file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in files})


@cache
def _is_near(test: str, path: str) -> bool:
    """True if the file of a test imports the module at a path."""
    package, _, name = module_of(path).rpartition(".")
    said = (ROOT / test.partition("::")[0]).read_text(encoding="utf-8")
    return f"{package}.{name} import" in said or re.search(rf"from {package} import .*\b{name}\b", said) is not None


@cache
def _is_there(test: str) -> bool:
    """False for a test that has gone since the map was made."""
    file, _, name = _function_of(test).partition(":")
    path = ROOT / file
    return path.exists() and f"def {name}(" in path.read_text(encoding="utf-8")


def interval(caught: int, of: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if not of:
        return 0.0, 1.0
    z, share = 1.96, caught / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return max(0.0, middle - half), min(1.0, middle + half)


def coverage(file: Path, tests: Sequence[str], uses: Uses, *, uncompiled: bool, again: bool) -> Coverage:
    """What was noted; if there is nothing, or it is asked for `again`, after a run of tests."""
    if again or not file.exists():
        file.unlink(missing_ok=True)
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "tests.mutants.blocks", "--blocks", file, "-m",
             "not slow and not realtime", "-p", "no:cacheprovider", *tests],
            cwd=ROOT, check=False, env={**os.environ, "FANET_NO_NUMBA": "1" if uncompiled else ""},
        )  # fmt: skip
    return Coverage(json.loads(file.read_text()), uses)


def run(count: int, seed: int, areas: Sequence[str], *, jobs: int, budget_s: float, again: bool) -> int:
    """Draw bugs, judge them, print the share."""
    reasons = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8")) if EQUIVALENT.exists() else {}
    equivalent = {entry["bug"]: entry["why"] for entry in reasons.get("bug", ())}
    candidates = all_bugs(areas)
    drawn = random.Random(f"bugs/{seed}").sample(candidates, min(count, len(candidates)))
    uses = all_uses()
    judge = Judge(
        coverage(MAP, ["tests"], uses, uncompiled=False, again=again),
        coverage(UNCOMPILED_MAP, OF_COMPILED, uses, uncompiled=True, again=again),
        budget_s=budget_s,
    )
    tally: dict[str, list[int]] = {area: [0, 0] for area in areas}
    survivors, skipped, by_flight = [], 0, 0
    with ThreadPoolExecutor(jobs) as pool:
        judged = pool.map(lambda bug: ("equivalent", 0.0) if bug.key in equivalent else judge.verdict(bug), drawn)
        for bug, (verdict, took_s) in zip(drawn, judged, strict=True):
            print(f"{took_s:6.1f} s  {verdict:10}  {bug}", flush=True)
            if verdict == "equivalent":
                skipped += 1
                continue
            area = area_of(bug.path)
            assert area is not None, "bugs are drawn in areas only"
            caught = verdict in ("caught", BY_FLIGHT)
            tally[area][0] += caught
            tally[area][1] += 1
            by_flight += verdict == BY_FLIGHT
            if not caught:
                survivors.append(bug)
    for area, (found, of) in [*tally.items(), ("all", [sum(part) for part in zip(*tally.values(), strict=True)])]:
        low, high = interval(found, of)
        print(f"{area:10} {found:4} of {of:4} caught" + (f": {found / of:.0%} ({low:.0%} to {high:.0%})" if of else ""))
    print(f"{by_flight} by kept flights only; {len(candidates)} bugs can be drawn, {skipped} drawn ones are equivalent")
    print("survivors:")
    for bug in survivors:
        print(f"  {bug.key}")
    return 0


def main() -> int:
    flags = argparse.ArgumentParser(prog="scripts/mutants --random", description=__doc__.splitlines()[0])
    flags.add_argument("--random", type=int, default=20, metavar="N", help="how many are drawn")
    flags.add_argument("--seed", type=int, default=1)
    flags.add_argument("--area", nargs="+", choices=list(AREAS), default=list(AREAS))
    flags.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="bugs at a time (%(default)s)")
    flags.add_argument("--budget", type=float, default=BUDGET_S, help="seconds of tests for one bug (%(default)s)")
    flags.add_argument("--map", action="store_true", help="measure anew which tests run which blocks")
    given = flags.parse_args()
    return run(given.random, given.seed, given.area, jobs=given.jobs, budget_s=given.budget, again=given.map)


if __name__ == "__main__":
    sys.exit(main())
