"""A method is understood in at most two classes: what it calls with `super()` calls no `super()` of the same name.

Constructors are left out: each names what it hands on.
"""

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[3]
PACKAGES = ("fanet_mw", "agents", "emulator", "sim")


class Known(NamedTuple):
    """What is known of a class from its text."""

    bases: list[str]
    passed_up: set[str]
    """The methods that call the method of the same name of a base."""
    own: set[str]


def classes() -> Iterator[tuple[str, Known]]:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if path.name != "fanet.py" and "class " in text:  # generated
                for node in classes_in(ast.parse(text).body):
                    yield node.name, known(node, passes="super()" in text)


def classes_in(body: Sequence[ast.stmt]) -> Iterator[ast.ClassDef]:
    """The classes of a module, those in others and in functions too."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield node
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield from classes_in(node.body)


def known(node: ast.ClassDef, *, passes: bool) -> Known:
    """What is known of a class; `passes`: some method may pass up calls."""
    methods = [item for item in node.body if isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef)]
    bases = [base.attr if isinstance(base, ast.Attribute) else getattr(base, "id", "") for base in node.bases]
    passed_up = {
        method.name for method in methods if passes and any(passes_up(call, method.name) for call in ast.walk(method))
    }
    return Known(bases, passed_up, {method.name for method in methods})


def passes_up(call: ast.AST, name: str) -> bool:
    """True for `super().name(...)`."""
    match call:
        case ast.Call(func=ast.Attribute(value=ast.Call(func=ast.Name(id="super")), attr=attr)):
            return attr == name
    return False


def test_no_chain_of_super_is_deeper_than_one() -> None:
    found: dict[str, list[Known]] = {}
    for name, described in classes():
        found.setdefault(name, []).append(described)

    def provider(name: str, method: str) -> list[Known]:
        """The classes of this name, or above, whose method a subclass reaches by `super()`."""
        reached = []
        for described in found.get(name, []):
            if method in described.own:
                reached.append(described)
            else:
                reached += [above for base in described.bases for above in provider(base, method)]
        return reached

    chained = sorted(
        f"{name}.{method}"
        for name, several in found.items()
        for described in several
        for method in described.passed_up - {"__init__"}
        for base in described.bases
        for above in provider(base, method)
        if method in above.passed_up
    )
    assert sum(len(described.passed_up) for several in found.values() for described in several) > 10, "it looks"
    assert chained == []
