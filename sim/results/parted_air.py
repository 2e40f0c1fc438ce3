"""The pairs of nodes between which faults leave no link, because a link is between two that hear each other: nodes on
different sides of a partition, and nodes of which one is in an area where a jammer lets nothing be received.

Not known here: jammers through which near nodes are still received, degraded links, nodes whose radio is off, and
partitions of so many nodes that their record does not name them.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from fanet_mw.scenario import Radio
from fanet_mw.trace import RadioFault
from sim.world.arrays import Flags, Rows

_NUMBERS: Final = {"line": 4, "circle": 4}
"""The numbers after each word of an extent (`extent_of` in fanet_mw/bus/radio_control.py); `nodes` has any."""


class Extent(NamedTuple):
    """Where a fault is, read from its record."""

    word: str
    """`nodes`, `line` or `circle`."""
    numbers: tuple[float, ...]
    """The nodes of one side; east and north of two points of a line; or east, north, radius and noise of a circle."""


class PartedAir:
    """The partitions and jammed areas that are in force after the records that were taken in, in their order."""

    def __init__(self, radio: Radio) -> None:
        self._all_deafen = radio.channel == "range"
        """Whether nothing is received in any jammed area, because the channel has no SNR."""
        self._by_label: dict[str, Extent] = {}

    def take(self, record: RadioFault) -> None:
        self._by_label.pop(record.label, None)
        extent = _read(record.extent) if record.active else None
        if extent is not None and (extent.word != "circle" or self._all_deafen or extent.numbers[3] == math.inf):
            self._by_label[record.label] = extent

    @property
    def in_force(self) -> tuple[Extent, ...]:
        return tuple(self._by_label.values())


def parted(extents: tuple[Extent, ...], at: Rows, nodes: npt.NDArray[np.int64]) -> Flags:
    """For each pair of these nodes, at these places: True if there can be no link between both. False for a node and
    itself.
    """
    cut = np.zeros((len(at), len(at)), bool)
    for word, numbers in extents:
        if word == "circle":
            east, north, radius_m, _ = numbers
            inside = np.hypot(at[:, 0] - east, at[:, 1] - north) <= radius_m
            cut |= inside[:, None] | inside[None]
            continue
        if word == "nodes":
            side = np.isin(nodes, numbers)
        else:
            east, north, other_east, other_north = numbers
            side = (other_east - east) * (at[:, 1] - north) > (other_north - north) * (at[:, 0] - east)
        cut |= side[:, None] != side[None]
    np.fill_diagonal(cut, val=False)
    return cut


def _read(text: str) -> Extent | None:
    """The extent that a record states; None if it states none, or no valid one."""
    word, *rest = text.split() or [""]
    try:
        numbers = tuple(map(float, rest))
    except ValueError:
        return None
    right = numbers if word == "nodes" else len(numbers) == _NUMBERS.get(word)
    return Extent(word, numbers) if right and not any(map(math.isnan, numbers)) else None
