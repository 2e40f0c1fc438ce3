"""Which tests run which blocks of the product: a pytest plugin, and the map that it writes.

    each block of a function (its body, the branches of its conditions, the bodies of its loops) notes that it ran
    ->  per test: the blocks, those of shared fixtures too, and the processor time  ->  map, as JSON

`pytest -p tests.mutants.blocks --blocks FILE TESTS` adds those of these tests that pass to the map. Other processes
note nothing, and compiled code does only where it runs uncompiled (FANET_NO_NUMBA=1): then nothing else does.
"""

import ast
import builtins
import functools
import importlib.abc
import importlib.machinery
import json
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
AREAS = {
    "protocol": ("fanet_mw/node", "fanet_mw/routing", "fanet_mw/timesync", "fanet_mw/delivery", "fanet_mw/wire",
                 "fanet_mw/graph"),
    "emulator": ("emulator", "fanet_mw/airtime.py"),
    "bounds": ("fanet_mw/bounds",),
    "results": ("sim/results", "sim/records", "sim/figures/figure", "sim/figures/paper_claims.py",
                "sim/figures/statistics.py"),
    "mission": ("agents/mission", "agents/applications"),
    "world": ("sim/world",),
}  # fmt: skip
PACKAGES = ("fanet_mw", "agents", "emulator", "sim")
_BODIES = ("body", "orelse", "finalbody")
UNCOMPILED = bool(os.environ.get("FANET_NO_NUMBA"))


def area_of(path: str) -> str | None:
    """The area of a file of the product; None if no bugs are drawn there."""
    return next((name for name, places in AREAS.items() if path.startswith(places)), None)


def is_compiled(source: str, path: str) -> bool:
    """True if numba may compile functions of a file, or reads constants of it."""
    return "from emulator.kernel.jit import" in source or path in ("emulator/kernel/state.py", "emulator/kernel/jit.py")


def blocks_of(tree: ast.AST) -> Iterator[tuple[str, list[ast.stmt]]]:
    """The blocks inside the functions of a module, by function and number: lines move with every change of a file."""
    seen: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            seen[node.name] += 1
            for number, body in enumerate(_inside(node.body)):
                yield f"{node.name}.{seen[node.name]}.{number}", body


def _inside(body: list[ast.stmt]) -> Iterator[list[ast.stmt]]:
    yield body
    for statement in body:
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            continue  # has blocks of its own
        for name in _BODIES:
            if inner := getattr(statement, name, None):
                yield from _inside(inner)
        for handler in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
            yield from _inside(handler.body)


class _Notes:
    """The blocks that ran since the last look."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.ran = bytearray()

    def add(self, path: str, block: str) -> int:
        self.names.append(f"{path}:{block}")
        self.ran.append(0)
        return len(self.names) - 1

    def taken(self) -> set[int]:
        found = {number for number, ran in enumerate(self.ran) if ran}
        self.ran[:] = bytes(len(self.ran))
        return found


NOTES = _Notes()


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname: str) -> Any:
        source = Path(self.path).read_text(encoding="utf-8")
        tree = ast.parse(source)
        path = Path(self.path).relative_to(ROOT).as_posix()
        for block, body in list(blocks_of(tree)):
            number = NOTES.add(path, block)
            first = body[0]
            at = int(isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant))
            note = ast.parse(f"__blocks_that_ran__[{number}] = 1").body[0]
            body.insert(at, ast.fix_missing_locations(ast.copy_location(note, first)))
        return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if fullname.partition(".")[0] not in PACKAGES:
            return None
        found = importlib.machinery.PathFinder.find_spec(fullname, path)
        if found is None or found.origin is None or not found.origin.endswith(".py"):
            return found
        name = Path(found.origin).relative_to(ROOT).as_posix()
        if area_of(name) and is_compiled(Path(found.origin).read_text(encoding="utf-8"), name) == UNCOMPILED:
            found.loader = _Loader(fullname, found.origin)
        return found


class _Caches:
    """The `functools.cache` functions of the product's modules: what a test finds there another one has run."""

    def __init__(self) -> None:
        self._modules = 0
        self._found: list[Any] = []

    def clear(self) -> None:
        if len(sys.modules) != self._modules:
            self._modules = len(sys.modules)
            ours = [module for name, module in sys.modules.items() if name.partition(".")[0] in PACKAGES]
            values = (value for module in ours for value in vars(module).values())
            self._found = [value for value in values if isinstance(value, functools._lru_cache_wrapper)]
        for cached in self._found:
            cached.cache_clear()


class Recorder:
    """What each test has run."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._tests: dict[str, tuple[float, set[int]]] = {}
        self._fixtures: dict[int, set[int]] = defaultdict(set)
        self._failed: set[str] = set()
        self._caches = _Caches()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope not in ("session", "package", "module", "class"):
            yield
            return
        before = NOTES.taken()
        yield
        self._fixtures[id(fixturedef)] |= NOTES.taken()
        for number in before:
            NOTES.ran[number] = 1

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        self._caches.clear()
        NOTES.taken()
        began_s = sum(os.times()[:4])
        yield
        ran = NOTES.taken()
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            for definition in definitions:
                ran |= self._fixtures.get(id(definition), set())
        self._tests[item.nodeid] = sum(os.times()[:4]) - began_s, ran

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.outcome != "passed":
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        known = json.loads(self._file.read_text()) if self._file.exists() else {"blocks": [], "tests": {}}
        numbers = {name: number for number, name in enumerate(known["blocks"])}
        for test, (took_s, ran) in self._tests.items():
            if test in self._failed:  # what fails without any bug notices none
                known["tests"].pop(test, None)
                continue
            names = sorted(NOTES.names[block] for block in ran)
            known["tests"][test] = [round(took_s, 3), [numbers.setdefault(name, len(numbers)) for name in names]]
        self._file.write_text(json.dumps({"blocks": list(numbers), "tests": known["tests"]}))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--blocks", type=Path, help="write there which test runs which blocks")


def pytest_configure(config: pytest.Config) -> None:
    file = config.getoption("--blocks")
    if file is not None:
        config.pluginmanager.register(Recorder(file.resolve()))


if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
    builtins.__blocks_that_ran__ = NOTES.ran  # type: ignore[attr-defined]
    sys.meta_path.insert(0, _Finder())
