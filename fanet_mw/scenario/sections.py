"""What all tables of a scenario file have in common: frozen, no unknown keys, every number within bounds.

A bound is there so that whatever a run computes from a number stays finite and ends: instants fit 64 bits of
nanoseconds, intervals are long enough to be counted, powers are within what any radio or noise has. None is a limit
that an experiment would meet.
"""

from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from fanet_mw.units import MAX_NODES

MOST_S: Final = 1e6
"""The longest duration: some eleven days."""

Duration = Annotated[float, Field(ge=0, le=MOST_S)]
"""Seconds."""
SomeTime = Annotated[float, Field(ge=1e-3, le=MOST_S)]
"""Seconds, at least a millisecond."""
Interval = Annotated[float, Field(ge=0.01, le=MOST_S)]
"""Seconds from one event to the next of its kind; at most a hundred of them are in a second."""
Milliseconds = Annotated[float, Field(ge=0, le=1e6)]
Rate = Annotated[float, Field(ge=0, le=1000)]
"""Events a second."""
Length = Annotated[float, Field(ge=0, le=1e6)]
"""Metres."""
SomeLength = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Metres, at least a millimetre."""
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
"""Metres from the origin, along one axis."""
Speed = Annotated[float, Field(ge=0, le=1000)]
"""Metres a second."""
Decibels = Annotated[float, Field(ge=0, le=300)]
"""A loss or a ratio."""
Level = Annotated[float, Field(ge=-300, le=300)]
"""A power or a ratio that may have either sign [dBm or dB]."""
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Id = Annotated[int, Field(ge=1, le=MAX_NODES)]


class Section(BaseModel):
    """The base of every table of a scenario file."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_default=True, allow_inf_nan=False, use_attribute_docstrings=True
    )
