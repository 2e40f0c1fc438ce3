"""The base of all tables of a scenario file: frozen, no unknown keys, every number within bounds.

The bounds exist so that all that a run computes stays finite: instants fit 64 bits of nanoseconds, intervals are long
enough to be counted, powers are those of some radio or noise. They are too wide to restrict any experiment.
"""

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Final, Literal, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from fanet_mw.units import MAX_NODES

NO_TRUTH: Final = "no_truth"
"""The kind of a mistake: `true` where a number is meant. Its message begins with the key within the table."""
MOST_S: Final = 1e6
"""The longest duration: some eleven days."""

Duration = Annotated[float, Field(ge=0, le=MOST_S)]
"""Seconds."""
SomeTime = Annotated[float, Field(ge=1e-3, le=MOST_S)]
"""Seconds, at least one millisecond."""
Interval = Annotated[float, Field(ge=0.01, le=MOST_S)]
"""Seconds between two events of the same kind, at least 10 ms."""
Milliseconds = Annotated[float, Field(ge=0, le=1e6)]
Rate = Annotated[float, Field(ge=0, le=1000)]
"""Events per second."""
Length = Annotated[float, Field(ge=0, le=1e6)]
"""Metres."""
SomeLength = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Metres, at least one millimetre."""
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
"""Metres from the origin, along one axis."""
Speed = Annotated[float, Field(ge=0, le=1000)]
"""Metres per second."""
Decibels = Annotated[float, Field(ge=0, le=300)]
"""A loss or a ratio."""
Level = Annotated[float, Field(ge=-300, le=300)]
"""A power or a ratio that may have either sign [dBm or dB]."""
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Id = Annotated[int, Field(ge=1, le=MAX_NODES)]


class Section(BaseModel):
    """The base of every table of a scenario file."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, tree: object) -> object:
        """Refuse `true` where a number is meant, which pydantic would take for 1."""
        for name, value in tree.items() if isinstance(tree, Mapping) else ():
            field = cls.model_fields.get(name)
            if field is not None and _has_truth(value) and not {bool, Any} & _types(field.annotation):
                raise PydanticCustomError(NO_TRUTH, "{key}: must not be true or false", {"key": name})
        return tree


def tables_of(table: type[Section]) -> Iterator[type[Section]]:
    """A table and all tables within it."""
    yield table
    for field in table.model_fields.values():
        for inner in _types(field.annotation):
            if isinstance(inner, type) and issubclass(inner, Section):
                yield from tables_of(inner)


@cache
def meanings(table: type[Section]) -> Mapping[str, str]:
    """What the string below each key of a table says. pydantic would read the sources of all tables at each start."""
    inherited = {key: said for base in table.__bases__ if base is not Section for key, said in meanings(base).items()}
    source = ast.parse(inspect.getsource(sys.modules[table.__module__]))
    body = next(node.body for node in source.body if isinstance(node, ast.ClassDef) and node.name == table.__name__)
    return inherited | {
        key.target.id: inspect.cleandoc(said.value.value)
        for key, said in pairwise(body)
        if isinstance(key, ast.AnnAssign)
        and isinstance(key.target, ast.Name)
        and isinstance(said, ast.Expr)
        and isinstance(said.value, ast.Constant)
        and isinstance(said.value.value, str)
    }


def _has_truth(value: object) -> bool:
    return isinstance(value, bool) or (isinstance(value, list | tuple) and any(map(_has_truth, value)))


def _types(annotation: object) -> set[object]:
    if get_origin(annotation) is Literal:
        return {type(choice) for choice in get_args(annotation)}
    found: set[object] = {annotation} if isinstance(annotation, type) or annotation is Any else set()
    return found.union(*map(_types, get_args(annotation)))


def read_with_file(key: str) -> AfterValidator:
    """Refuse a file that is read with the scenario and was not, because there is no scenario file that names it."""

    def refuse(path: str) -> str:
        if path:
            raise ValueError(f"{key} = {path!r}: is read with a scenario file only")
        return path

    return AfterValidator(refuse)
