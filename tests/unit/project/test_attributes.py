"""No class holds more than fifteen attributes, unless its docstring says why."""

import ast

import pytest
from test_documents import ROOT

GENERATED = ROOT / "fanet_mw" / "dialect" / "fanet.py"


def attributes(found: ast.ClassDef) -> set[str]:
    """The attributes that the methods of a class set on themselves."""
    return {
        node.attr
        for node in ast.walk(found)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }


@pytest.mark.parametrize("folder", ["fanet_mw", "agents", "emulator", "sim"])
def test_a_class_with_more_than_fifteen_attributes_says_why(folder: str) -> None:
    counted = 0
    for path in {*(ROOT / folder).rglob("*.py")} - {GENERATED}:
        for found in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(found, ast.ClassDef):
                counted += 1
                assert len(attributes(found)) <= 15 or "attributes" in (ast.get_docstring(found) or ""), found.name
    assert counted
