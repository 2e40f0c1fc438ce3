"""Which blocks use a constant of a module: by its name, through imports, and through what is computed from it.

    X: Final = 3 in a.py  ->  Y: Final = 2 * X in a.py  ->  `from a import Y` in b.py  ->  the blocks of b.py that say Y

A name inside a function counts for the module's name even where a local one hides it: too many tests are asked then,
never too few.
"""

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from tests.mutants.blocks import blocks_of

_INNER = ("body", "orelse", "finalbody")
_DEFINED = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class Name(NamedTuple):
    """A name of a module; none: the module itself."""

    module: str
    name: str


def module_of(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


class Uses:
    """The uses of all names of some modules, of which `sources` has the text by path."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        self._trees = {module_of(path): ast.parse(text) for path, text in sources.items()}
        self._imported: dict[Name, Name] = {}
        self._stars: dict[str, list[str]] = defaultdict(list)
        self._defined: set[Name] = set()
        for module, tree in self._trees.items():
            self._read(module, tree)
        self._blocks: dict[Name, set[str]] = defaultdict(set)
        self._computed: dict[Name, set[Name]] = defaultdict(set)
        """What is computed from a name where a module is imported: other constants, classes with such a default."""
        for path in sources:
            self._note(path, module_of(path))

    def blocks(self, path: str, name: str) -> set[str]:
        """The blocks that use a name, or what is computed from it, as `PATH:BLOCK`."""
        found, left, seen = set[str](), [Name(module_of(path), name)], set[Name]()
        while left:
            this = left.pop()
            if this not in seen:
                seen.add(this)
                found |= self._blocks[this]
                left += self._computed[this]
        return found

    def _read(self, module: str, tree: ast.Module) -> None:
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module in self._trees:
                for alias in node.names:
                    if alias.name == "*":
                        self._stars[module].append(node.module)
                    else:
                        self._imported[Name(module, alias.asname or alias.name)] = self._meant(node.module, alias.name)
        self._defined |= {Name(module, name) for statement in tree.body for name in _names_of(statement)}

    def _meant(self, module: str, name: str) -> Name:
        inner = f"{module}.{name}"
        return Name(inner, "") if inner in self._trees else Name(module, name)

    def _home(self, name: Name) -> Name | None:
        """Where a name that a module knows is defined."""
        if name in self._defined or not name.name:
            return name
        if name in self._imported:
            return self._home(self._imported[name])
        homes = (self._home(Name(module, name.name)) for module in self._stars[name.module])
        return next((home for home in homes if home), None)

    def _said(self, module: str, nodes: Iterable[ast.AST]) -> Iterator[Name]:
        for node in nodes:
            if isinstance(node, ast.Name) and (home := self._home(Name(module, node.id))):
                yield home
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                whole = self._imported.get(Name(module, node.value.id))
                if whole and not whole.name and (home := self._home(Name(whole.module, node.attr))):
                    yield home

    def _note(self, path: str, module: str) -> None:
        blocks = list(blocks_of(self._trees[module]))
        for block, body in blocks:
            for name in self._said(module, (node for statement in body for node in _outside_of_blocks(statement))):
                self._blocks[name].add(f"{path}:{block}")
        for statement in self._trees[module].body:
            defined = {Name(module, name) for name in _names_of(statement)}
            for name in self._said(module, _outside_of_blocks(statement)):
                self._computed[name] |= defined
            if isinstance(statement, _DEFINED):
                (this,) = defined
                functions = [node for node in ast.walk(statement) if isinstance(node, ast.FunctionDef)]
                mine = {id(node) for function in functions for node in function.body}
                self._blocks[this] |= {f"{path}:{block}" for block, body in blocks if id(body[0]) in mine}


def _names_of(statement: ast.stmt) -> Iterator[str]:
    """What a statement of a module defines."""
    match statement:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            yield name
        case ast.AnnAssign(target=ast.Name(id=name)):
            yield name
        case ast.Assign(targets=targets):
            yield from (n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name))


def _outside_of_blocks(statement: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a statement but for those of the blocks inside it."""
    yield statement
    function = isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef)
    for field, value in ast.iter_fields(statement):
        if field in _INNER and isinstance(value, list) and (function or not isinstance(statement, ast.ClassDef)):
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST):
                yield from _outside_of_blocks(node)
