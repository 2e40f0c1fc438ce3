"""A timetable that was found for a swarm and its load, with the use of its turns (`turn_allocation.py` finds it)."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.timetable import Timetable
from fanet_mw.units import NodeId

NO_LOADS: Final[Mapping[NodeId, int]] = MappingProxyType({})
"""All nodes send as the scenario states."""


class FittedTimetable(NamedTuple):
    """A timetable, and how its turns are used."""

    turns: Turns
    table: Timetable
    together: int
    """The greatest number of packets that a root transmits in one turn."""
    frame_bytes: int
    """The number of bytes that one turn can carry."""
    whole: bool
    """True if each node transmits its own packets; otherwise heads transmit those of their members."""
    enough: bool
    """True if the turns suffice for the load."""
    odds: Odds | None = None
    """The odds of a timetable for lossy links; None for a timetable that assumes no losses."""
    loads: Mapping[NodeId, int] = NO_LOADS
    """The loads for which the timetable was made, of the nodes that do not send as the scenario states."""
