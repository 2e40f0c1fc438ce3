#!/usr/bin/env python3
"""The size of the house: lines by kind, files, words of documents, files that a packet enters, circles of folders.

`scripts/census.py [TREE]` counts a tree; `scripts/census.py TREE TREE` prints two of them beside each other;
`--small` lists files that could go into their one reader, `--questions` what a reviewer might ask about.
"""

import argparse
import ast
import io
import os
import re
import signal
import statistics
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Final

PRODUCT: Final = ("fanet_mw", "agents", "emulator", "sim")
GENERATED: Final = ("fanet_mw/dialect/fanet.py",)
SMALL_LINES: Final = 60
WORDS: Final = 10
SENTENCES: Final = 4
ATTRIBUTES: Final = 15
WRITTEN: Final = re.compile(
    r"<!-- (?:[a-z]+: )?([\w-]+):? (?:generated )?by (?:python tests|scripts)/.*?<!-- end of \1 -->", re.DOTALL
)
"""A part of a page that a command of ours writes between its marks."""


def python_files(tree: Path, folder: str) -> list[Path]:
    """The sources of a folder, without what is generated."""
    found = sorted((tree / folder).rglob("*.py"))
    return [path for path in found if path.relative_to(tree).as_posix() not in GENERATED]


def kinds_of_lines(text: str) -> Counter[str]:
    """How many lines of a source are logic, imports, docstrings, comments and blank."""
    lines = text.splitlines()
    kinds = ["blank" if not line.strip() else "logic" for line in lines]
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip():
            kinds[token.start[0] - 1] = "comments"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            kind = "docstrings"  # those of attributes too
        elif isinstance(node, ast.Import | ast.ImportFrom):
            kind = "imports"
        else:
            continue
        for number in range(node.lineno - 1, node.end_lineno or node.lineno):
            kinds[number] = kind
    return Counter(kinds)


def module_of(tree: Path, path: Path) -> str:
    parts = path.relative_to(tree).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(tree: Path, paths: list[Path]) -> dict[str, set[str]]:
    """Which modules of the product each of them imports, inside functions too; what a package exports counts as the
    package.
    """
    modules = {module_of(tree, path): path for path in paths}
    found: dict[str, set[str]] = {}
    for module, path in modules.items():
        needed = found.setdefault(module, set())
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                continue
            for name in names:
                known = name if name in modules else name.rpartition(".")[0]
                if known in modules and known != module:
                    needed.add(known)
    return found


def circles(needs: dict[str, set[str]]) -> list[str]:
    """Groups of neighbors in one folder, folders or files, that need each other by whatever way."""
    inside: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for module, needed in needs.items():
        for other in needed:
            mine, theirs = module.split("."), other.split(".")
            common = 0
            while common < min(len(mine), len(theirs)) and mine[common] == theirs[common]:
                common += 1
            if 0 < common < min(len(mine), len(theirs)):
                inside[".".join(mine[:common])][mine[common]].add(theirs[common])
    return [
        f"{folder}: {' '.join(sorted(group))}"
        for folder, graph in sorted(inside.items())
        for group in strongly_connected(graph)
        if len(group) > 1
    ]


def strongly_connected(graph: dict[str, set[str]]) -> list[set[str]]:
    """Groups in which everyone reaches everyone."""

    def reached(start: str) -> set[str]:
        found, waiting = {start}, [start]
        while waiting:
            for other in graph.get(waiting.pop(), ()):
                if other not in found:
                    found.add(other)
                    waiting.append(other)
        return found

    reach = {name: reached(name) for name in sorted(graph)}
    groups: list[set[str]] = []
    for name in reach:
        group = {other for other in reach[name] if name in reach.get(other, ())}
        if group not in groups:
            groups.append(group)
    return groups


def signatures(tree: Path, paths: list[Path]) -> Iterator[tuple[int, str]]:
    """Each function with its number of parameters."""
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                given = node.args
                count = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
                yield count, f"{path.relative_to(tree)}:{node.name}"


def files_entered(tree: Path) -> Iterator[tuple[str, str]]:
    """How many files of `fanet_mw` a packet of each kind enters on its way through one node, and through how many at
    the most in one call.
    """
    rows = [
        line.split(" | ") for line in (tree / "ARCHITECTURE.md").read_text().splitlines() if "`node/node.py`" in line
    ]
    ways: dict[str, list[set[str]]] = defaultdict(list)
    for row in rows:
        if len(row) == 3 and row[0].startswith("| "):
            ways[row[0][2:]].append({name.strip("` |") for name in row[2].split(",")})
    for kind, passes in ways.items():
        yield f"files a packet enters, {kind}", f"{len(set().union(*passes))} (in one call {max(map(len, passes))})"


COMPANION: Final = """
import resource, sys, time
began_s = time.perf_counter()
import agents.__main__
from agents.clock.clocked_uav import make_uav
from fanet_mw.scenario import config
from fanet_mw.units import Enu, NodeId
make_uav(config.build({}), NodeId(2), "swarm", position=Enu(0.0, 0.0, 50.0))
took_s = time.perf_counter() - began_s
parts = ("fanet_mw", "agents", "emulator", "sim")
files = {m.__file__ for n, m in list(sys.modules.items()) if n.partition(".")[0] in parts and getattr(m, "__file__", 0)}
lines = sum(len(open(file).readlines()) for file in files if not file.endswith("dialect/fanet.py"))
print(len(files), lines, round(took_s, 2), round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))
"""


def companion(tree: Path) -> Iterator[tuple[str, str]]:
    """What a companion computer loads for one UAV: files and lines of the product, time and memory."""
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", COMPANION], cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    names = ("files", "lines without the dialect", "seconds to start", "MB of memory")
    yield from zip((f"a companion computer, {name}" for name in names), done.stdout.split(), strict=True)


def words(tree: Path) -> Iterator[tuple[str, str]]:
    """Words of the documents by folder, and how many were generated: whole pages (a comment says so), and what
    stands between the marks of a command.
    """
    counted: Counter[str] = Counter()
    generated: Counter[str] = Counter()
    for path in [*sorted(tree.glob("*.md")), *sorted((tree / "docs").rglob("*.md"))]:
        text = path.read_text()
        folder = path.relative_to(tree).parent.as_posix()
        by_hand = "" if "<!-- generated by scripts/" in text[:600].lower() else WRITTEN.sub("", text)
        counted[folder] += len(by_hand.split())
        generated[folder] += len(text.split()) - len(by_hand.split())
    for folder, count in sorted(counted.items()):
        yield f"words by hand, {folder}", f"{count}"
    yield "words by hand, all", f"{sum(counted.values())}"
    yield "words generated", f"{sum(generated.values())}"


def census(tree: Path) -> dict[str, str]:
    """Every figure by its name."""
    paths = [path for folder in PRODUCT for path in python_files(tree, folder)]
    lengths = {path: len(path.read_text().splitlines()) for path in paths}
    kinds: Counter[str] = Counter()
    for path in paths:
        kinds += kinds_of_lines(path.read_text())
    needs = imports(tree, paths)
    importers: Counter[str] = Counter(other for needed in needs.values() for other in needed)
    lone = [path for path in paths if path.stem != "__init__" and importers[module_of(tree, path)] == 1]
    found = {"lines of product": str(sum(lengths.values()))}
    found |= {f"  {kind}": str(count) for kind, count in kinds.most_common()}
    for folder in PRODUCT:
        found[f"  in {folder}"] = str(
            sum(lines for path, lines in lengths.items() if path.is_relative_to(tree / folder))
        )
    found["lines of tests"] = str(sum(len(path.read_text().splitlines()) for path in python_files(tree, "tests")))
    found["files of product"] = str(len(paths))
    found["  median lines"] = str(int(statistics.median(lengths.values())))
    found["  under 50 lines"] = str(sum(lines < 50 for lines in lengths.values()))
    found[f"  under {SMALL_LINES} with one importer"] = str(sum(lengths[path] < SMALL_LINES for path in lone))
    count, where = max(signatures(tree, paths))
    found["longest signature"] = f"{count} ({where})"
    found |= dict(files_entered(tree))
    found |= dict(companion(tree))
    rounds = circles(needs)
    found["circles of folders and files"] = str(len(rounds))
    found |= {f"  {circle}": "" for circle in rounds}
    found |= dict(words(tree))
    return found


def questions(tree: Path) -> Iterator[str]:
    """Places that a reviewer may ask about; no number here is a limit."""
    for folder in (*PRODUCT, "tests"):
        for path in python_files(tree, folder):
            for node in ast.walk(ast.parse(path.read_text())):
                if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                    continue
                where = f"{path.relative_to(tree)}:{node.lineno}: {node.name}"
                said = ast.get_docstring(node) or ""
                if folder == "tests":
                    words = len(node.name.split("_")) - 1
                    if node.name.startswith("test_") and words > WORDS:
                        yield f"{where}: {words} words"
                    continue
                if re.search(r"\b(we|our|ours)\b", said, re.IGNORECASE):
                    yield f"{where}: speaks of its authors"
                if len(re.findall(r"[.!?](?:\s|$)", said.replace("e.g.", ""))) > SENTENCES:
                    yield f"{where}: more than {SENTENCES} sentences"
                if isinstance(node, ast.ClassDef):
                    stored = {
                        target.attr
                        for inner in ast.walk(node)
                        for target in ast.walk(inner)
                        if isinstance(target, ast.Attribute) and isinstance(target.ctx, ast.Store)
                        and isinstance(target.value, ast.Name) and target.value.id == "self"
                    }  # fmt: skip
                    if len(stored) > ATTRIBUTES:
                        yield f"{where}: {len(stored)} attributes"


def tree_of(name: str) -> Path:
    tree = Path(name).resolve()
    if not (tree / PRODUCT[0]).is_dir():
        raise argparse.ArgumentTypeError(f"{name} has no folder {PRODUCT[0]}/")
    return tree


def main() -> int:
    here = Path(__file__).parents[1]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trees", nargs="*", type=tree_of, default=[here], metavar="TREE")
    parser.add_argument("--small", action="store_true")
    parser.add_argument("--questions", action="store_true")
    asked = parser.parse_args()
    if asked.questions:
        print(*questions(here), sep="\n")
        return 0
    if asked.small:  # what could be folded into its one reader
        paths = [path for folder in PRODUCT for path in python_files(here, folder)]
        needs = imports(here, paths)
        for path in paths:
            users = [module for module, needed in needs.items() if module_of(here, path) in needed]
            lines = len(path.read_text().splitlines())
            if path.stem != "__init__" and len(users) == 1 and lines < SMALL_LINES:
                print(f"{lines:4} {path.relative_to(here)}  <- {users[0]}")
        return 0
    counted = [census(tree) for tree in asked.trees]
    names = list(dict.fromkeys(name for found in counted for name in found))
    for name in names:
        print(f"{name:62}", *(f"{found.get(name, '-'):>14}" for found in counted))
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # into `head` it ends without a word, as other commands do
    sys.exit(main())
