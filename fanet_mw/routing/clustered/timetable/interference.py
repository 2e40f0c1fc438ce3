"""Interference: whose transmissions disturb each other, so that they must not share a turn of a timetable.

    InterferenceByDistance    for links without losses (`list_scheduling.py`): by the distance alone
    InterferenceByPower       for lossy links (`redundant_scheduling.py`): by the powers that nodes measure

Beside it the parts that both schedulers of floods share: the geometry, how many floods may begin at a time, and their
reach. Only the receivers that a frame is meant for count: nobody minds if another node cannot receive it. Sets of nodes
are represented as the bits of integers, by the nodes' row numbers.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple, Protocol, TypeVar

from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.links import Link

RECEIVER: Final = 100
"""The worth of serving one more node, with all the copies that it needs, in units of turns of the flood's age."""
ONLY: Final = 50
"""The additional worth if no other holder of the packet could serve that node."""
WINDOW: Final = 24
"""The greatest number of floods under way at once. More would cost computing time and gain little."""


class Geometry(NamedTuple):
    """The geometry for which a timetable is computed."""

    link_m: float
    """The greatest distance at which nodes receive each other."""
    interference_m: float
    """The greatest distance at which a sender disturbs a receiver of another frame."""
    turns: int
    hop_turns: int
    """The turns from the one in which a packet arrives to the first that can relay it; 1: the next turn."""
    margin_m: float = 0.0
    """By so much shorter links are preferred, because positions have errors; the others are used where nodes would be
    cut off without them."""
    links_by: tuple[tuple[NodeId, float], ...] = ()
    """How many times as far as others nodes receive, and are received, that have an antenna of their own."""
    interference_by: tuple[tuple[NodeId, float], ...] = ()
    """The same of how far they disturb, and are disturbed."""


class NodeRows:
    """The nodes of a swarm, and the row number of each."""

    def __init__(self, nodes: Iterable[NodeId]) -> None:
        self.ids = tuple(nodes)
        self.row = {node: row for row, node in enumerate(self.ids)}
        self.everyone = (1 << len(self.ids)) - 1

    def of(self, bits: int) -> tuple[NodeId, ...]:
        """The nodes of a bit set, in the order of their rows."""
        return tuple(self.ids[row] for row in rows(bits))


class Placed(Protocol):
    """A flood, as far as a scheduler has scheduled it."""

    sent: list[tuple[int, int]]
    """The transmissions of this flood as (offset, row), in order."""


def age(flood: Placed, offset: int) -> int:
    """The number of turns since a flood began; 0 if it has not begun."""
    return offset - flood.sent[0][0] if flood.sent else 0


AnyFlood = TypeVar("AnyFlood", bound=Placed)


def turn_by_turn(
    floods: Sequence[AnyFlood], *, turns: int, window: int, pace: float
) -> Iterator[tuple[int, int, dict[int, AnyFlood]]]:
    """The turns until all floods are scheduled: offset, how many have begun, and those under way, from which the caller
    removes completed ones. They begin evenly over the share `pace` of `turns`, at most `window` at once.
    """
    count, begun, offset = len(floods), 0, 0
    under_way: dict[int, AnyFlood] = {}
    while begun < count or under_way:
        while begun < count and len(under_way) < window and offset * count >= int(begun * turns * pace):
            under_way[begun] = floods[begun]
            begun += 1
        yield offset, begun, under_way
        offset += 1


def reach(hears: Sequence[int], root: int) -> tuple[int, int]:
    """The rows that a flood from this row can reach, itself included, and the number of hops to the farthest."""
    found = frontier = 1 << root
    hops = -1
    while frontier:
        hops += 1
        near = 0
        for row in rows(frontier):
            near |= hears[row]
        frontier = near & ~found
        found |= near
    return found, hops


def rows(bits: int) -> list[int]:
    """The rows of a bit set, ascending."""
    found = []
    while bits:
        low = bits & -bits
        found.append(low.bit_length() - 1)
        bits ^= low
    return found


_CHANCES: Final = (0.5, 0.25, 0.1)
"""The least share of frames that must arrive over a link for it to be used; lower ones if nodes would be cut off."""
_SINR_DB: Final = 11
"""A frame survives another one in its turn if stronger by this: 8 dB at 11 Mb/s, and a margin of 3 dB."""
_DECADE_DB: Final = 30
"""The decrease of power over a decade of distance."""


class InterferenceByDistance:
    """Links without losses: nodes receive each other up to `link_m`, and disturb each other up to `interference_m`."""

    def __init__(self, positions: Sequence[tuple[NodeId, Enu]], geometry: Geometry) -> None:
        self.nodes = NodeRows(node for node, _ in positions)
        self._parts: dict[int, tuple[int, int]] = {}
        at = tuple(place for _, place in positions)
        far = self._factors(geometry.links_by)
        self.hears = _within(at, geometry.link_m, far)
        sure = _within(at, geometry.link_m, far, geometry.margin_m)
        parts = ([reach(links, row)[0] for row in range(len(at))] for links in (sure, self.hears))
        self.sure = not geometry.margin_m or next(parts) == next(parts)
        """True if the links that are farther than errors of positions from the end of the range connect as many."""
        if self.sure:
            self.hears = sure
        disturbed_m = max(geometry.interference_m, geometry.link_m)
        self.disturbs = _within(at, disturbed_m, self._factors(geometry.interference_by))

    def _factors(self, by: Sequence[tuple[NodeId, float]]) -> tuple[tuple[int, float], ...]:
        return tuple((self.nodes.row[node], times) for node, times in by if node in self.nodes.row)

    def part(self, root: int) -> tuple[int, int]:
        """The rows that a flood from this row can reach, itself included, and the number of hops to the farthest."""
        if root not in self._parts:
            self._parts[root] = reach(self.hears, root)
        return self._parts[root]

    def way(self, node: NodeId, head: NodeId) -> list[int]:
        """Rows of a shortest way to the head, ends included, lowest first among equals; empty for or without a head."""
        start, end = self.nodes.row[node], self.nodes.row.get(head)
        if end is None or start == end:
            return []
        before = {start: start}
        frontier = [start]
        while frontier and end not in before:
            following = []
            for row in frontier:
                for near in rows(self.hears[row]):
                    if near not in before:
                        before[near] = row
                        following.append(near)
            frontier = following
        if end not in before:
            return []
        found = [end]
        while found[-1] != start:
            found.append(before[found[-1]])
        return found[::-1]


class InterferenceByPower:
    """Lossy links as nodes have measured them: a frame is disturbed by what is not weaker enough at its receiver."""

    def __init__(
        self, positions: Sequence[tuple[NodeId, Enu]], geometry: Geometry, measured: Sequence[Link], *, margin_db: float
    ) -> None:
        """`interference_m`: for pairs that do not receive each other, and links `margin_db` over the weakest; a greater
        margin keeps senders of a turn farther apart.
        """
        self.nodes = NodeRows(node for node, _ in positions)
        row = self.nodes.row
        known = [link for link in measured if link.a in row and link.b in row]
        self._dbm = {
            pair: link.power_dbm for link in known for pair in ((row[link.a], row[link.b]), (row[link.b], row[link.a]))
        }
        self.senses = self._links(known, least=0.0)
        self.hears, chance = self._connected(known)
        self.dose: dict[tuple[int, int], int] = {}
        """The grade of each link, by (sender, receiver)."""
        for link in known:
            if link.chance >= chance:
                a, b = row[link.a], row[link.b]
                self.dose[a, b] = self.dose[b, a] = max(1, link.grade)
        far = {row[node]: times for node, times in geometry.interference_by if node in row}
        at = [place for _, place in positions]
        self._disturbing = self._who_disturbs(at, geometry.interference_m, margin_db, far)

    def _links(self, known: Sequence[Link], *, least: float) -> list[int]:
        row, found = self.nodes.row, [0] * len(self.nodes.ids)
        for link in known:
            if link.chance >= least:
                a, b = row[link.a], row[link.b]
                found[a] |= 1 << b
                found[b] |= 1 << a
        return found

    def _connected(self, known: Sequence[Link]) -> tuple[list[int], float]:
        """The best links that keep the swarm as connected as it is, and the least share of frames over them."""
        choices = [(self._links(known, least=least), least) for least in _CHANCES]
        whole = [reach(choices[-1][0], row)[0] for row in range(len(self.nodes.ids))]
        for hears, least in choices:
            if [reach(hears, row)[0] for row in range(len(self.nodes.ids))] == whole:
                return hears, least
        raise AssertionError("the last choice is the whole")

    def _who_disturbs(
        self, at: Sequence[Enu], interference_m: float, margin_db: float, far: Mapping[int, float]
    ) -> dict[tuple[int, int], int]:
        """The rows whose frames disturb each link; `far`: those that disturb, and are disturbed, so much farther."""
        weakest = min((dbm for dbm in self._dbm.values()), default=0)
        times = [far.get(row, 1.0) for row in range(len(at))]
        apart = [
            [here.minus(there).norm() / max(times[row], times[other]) for other, there in enumerate(at)]
            for row, here in enumerate(at)
        ]
        found = {}
        for sender, receiver in self.dose:
            dbm = self._dbm[sender, receiver]
            near_m = interference_m * math.pow(10.0, (weakest + margin_db - dbm) / _DECADE_DB)
            found[sender, receiver] = sum(
                1 << other
                for other in range(len(at))
                if other not in (sender, receiver)
                and self._spoils(other, receiver, dbm, apart[other][receiver], near_m)
            )
        return found

    def _spoils(self, other: int, receiver: int, dbm: int, apart_m: float, near_m: float) -> bool:
        heard_dbm = self._dbm.get((other, receiver))
        return apart_m <= near_m if heard_dbm is None else heard_dbm > dbm - _SINR_DB

    def disturbing(self, sender: int, receiver: int) -> int:
        """The rows whose frames disturb this link."""
        return self._disturbing[sender, receiver]


@lru_cache(maxsize=8)
def _within(
    at: tuple[Enu, ...], reach_m: float, far: tuple[tuple[int, float], ...] = (), margin_m: float = 0.0
) -> tuple[int, ...]:
    """For each place, the others within reach, less a margin; `far`: rows that reach so many times as far. Many
    timetables are tried for the same places.
    """
    times = dict(far)
    return tuple(
        sum(
            1 << other
            for other, there in enumerate(at)
            if other != row
            and math.dist(here, there) <= reach_m * max(times.get(row, 1.0), times.get(other, 1.0)) - margin_m
        )
        for row, here in enumerate(at)
    )
