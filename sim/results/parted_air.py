"""The pairs of nodes between which faults let nothing pass: on different sides of a partition, or one of the two in an
area so jammed that nothing is received there, because a link is between two who hear each other.

Not known here: jammers through which near nodes are still received, and weaker links.
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
    numbers: tuple[float, ...]


class PartedAir:
    """The partitions and jammed areas in force, as records tell in their order."""

    def __init__(self, radio: Radio) -> None:
        self._all_deafen = radio.channel == "range"  # it has no SNR
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
    """Whether nothing passes between each pair of these nodes at these places; never true of a node and itself."""
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
    """The extent that a record states; None if it states none."""
    word, *rest = text.split() or [""]
    try:
        numbers = tuple(map(float, rest))
    except ValueError:
        return None
    right = numbers if word == "nodes" else len(numbers) == _NUMBERS.get(word)
    return Extent(word, numbers) if right and not any(map(math.isnan, numbers)) else None
