"""One name for one thing: no two classes have the same name, leading underscores aside."""

import ast
from collections import defaultdict
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[3]
PACKAGES: Final = ("fanet_mw", "agents", "emulator", "sim")
TWICE: Final = {"Node"}
"""A node of the protocol, and what a program holds of it (`fanet_mw.join`)."""


def test_no_two_classes_have_the_same_name() -> None:
    places = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef) and "dialect" not in path.parts:
                    places[node.name.lstrip("_")].append(str(path.relative_to(ROOT)))
    assert {name: where for name, where in places.items() if len(where) > 1 and name not in TWICE} == {}
