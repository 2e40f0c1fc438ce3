"""The base of all tables of a scenario file: frozen, no unknown keys, every number within bounds.

The bounds exist so that all that a run computes stays finite: instants fit 64 bits of nanoseconds, intervals are long
enough to be counted, powers are those of some radio or noise. They are too wide to restrict any experiment.
"""

from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from fanet_mw.units import MAX_NODES

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

    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_default=True, allow_inf_nan=False, use_attribute_docstrings=True
    )
