"""Which links a bound counts on: those to neighbors that keep the same rounds, and that will stay within range.

Two nodes that fly straight on lose each other when their distance exceeds the range (link expiration time; Su, Lee and
Gerla, 2001), or when a building of the map comes between them. A neighbor is taken to stay within range if it is there
and hardly recedes, if its position is not known, or if this UAV flies so that it stays. A UAV often lets go of a
neighbor and holds it again at once, and news of both changes travel for seconds. For `_LET_GO_NS` their link must
therefore last only as long as its end takes to be noticed.
"""

from collections.abc import Iterator, Mapping
from functools import reduce
from operator import or_
from typing import Final

from fanet_mw.graph.topology import bits_of
from fanet_mw.motion import Motion
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.units import Enu, NodeId, S

_RECEDING_M_S: Final = 1.0
"""A lower speed at which a neighbor recedes is taken for an error of positioning."""
_AGAIN: Final = 1.5
"""A link that was given up counts again when it will last so many times as long."""
_LET_GO_NS: Final = 1 * S
"""So long after a node has kept a neighbor in reach their link need not last as long as others."""


class LastingLinks:
    """The links of one node that will last."""

    def __init__(
        self, *, range_m: float, horizon_ns: int, noticed_ns: int, reaches: Mapping[NodeId, float] = {}
    ) -> None:
        """`horizon_ns`: how long a link must last; `noticed_ns`: after which time its end is noticed; `reaches`: by
        which factor a link with each of these nodes is longer than `range_m`.
        """
        self._range_m = range_m
        self._farther_m = {node: times * range_m for node, times in reaches.items()}
        self._horizon_ns, self._noticed_ns = horizon_ns, noticed_ns
        self._motions: dict[NodeId, Motion] = {}
        self._given_up = 0
        """The neighbors whose links did not count when this was last asked, as a set of bits."""
        self.held = 0
        """The neighbors that this node keeps in reach by how it flies, as a set of bits."""
        self.sight_ends_ns: Mapping[NodeId, int] = {}
        """The instants at which lines of sight to neighbors will end behind buildings."""
        self._held_ns: dict[int, int] = {}
        """When each neighbor was kept in reach last, by its bit."""
        self.gone = 0
        """The neighbors that were out of range when this was last asked, if they flew on as they last said; as a set of
        bits.
        """

    def hear(self, node: NodeId, motion: Motion) -> None:
        """A neighbor has told where it is."""
        self._motions[node] = motion

    def among(self, near: int, own: Motion) -> int:
        """Those of a set of neighbors whose links will last, if this node flies on as it does now."""
        until_ns = own.at_ns + self._horizon_ns
        hidden = bits_of(node for node, ends_ns in self.sight_ends_ns.items() if ends_ns <= until_ns)
        lasting, self.gone = near & ~hidden, 0
        for bit, motion, range_m in self._known(near, own):
            here = motion.offset_from(own.position, own.at_ns)
            distance_m = here.norm()
            if distance_m > range_m:
                self.gone |= bit
            if self.held & bit:
                self._held_ns[bit] = own.at_ns
                continue
            drift = motion.velocity.minus(own.velocity)
            if not self._lasts(here, drift, distance_m, range_m, for_ns=self._asked_ns(bit, own.at_ns)):
                lasting &= ~bit
        self._given_up = near & ~lasting
        return lasting

    def _known(self, nodes: int, own: Motion) -> Iterator[tuple[int, Motion, float]]:
        """Those of a set of nodes whose motion is known from within the horizon, with the range of each link."""
        for node, motion in self._motions.items():
            bit = 1 << (node - 1)
            if nodes & bit and own.at_ns - motion.at_ns <= self._horizon_ns:
                yield bit, motion, self._farther_m.get(node, self._range_m)

    def _asked_ns(self, bit: int, now_ns: int) -> float:
        """How long the link with a neighbor must last to count."""
        if self._given_up & bit:
            return _AGAIN * self._horizon_ns
        held_ns = self._held_ns.get(bit)
        return self._noticed_ns if held_ns is not None and now_ns - held_ns <= _LET_GO_NS else self._horizon_ns

    def _lasts(self, here: Enu, drift: Enu, distance_m: float, range_m: float, *, for_ns: float) -> bool:
        receding_m_s = (here.east * drift.east + here.north * drift.north + here.up * drift.up) / max(distance_m, 1.0)
        stays = distance_m <= range_m and receding_m_s < _RECEDING_M_S
        return stays or here.plus(drift, for_ns / S).norm() <= range_m


class InStep:
    """Which neighbors keep the same rounds as this node, by when the frames of their turns came. A node out of step
    sends in others' turns: no bound counts on it, nor, where it is heard, on the owners of those turns.
    """

    def __init__(self, timing: RoundTiming, *, certain: bool) -> None:
        """`certain`: all clocks are exact."""
        self._timing = timing
        self._keeping = -1 if certain else 0
        """The nodes in step, bit i for node i + 1."""
        self._destroyed: dict[int, int] = {}
        """For each node out of step, those whose frames it destroys, as a set of bits."""
        self.certain = certain
        """True if nobody can be out of step."""

    def hear(self, node: int, end_ns: int) -> None:
        """A frame that a node sends in its turn has ended."""
        owner = None if self.certain else self._timing.owner(end_ns)
        if owner is None:
            return
        own = 1 << (node - 1)
        if owner == node:
            self._keeping |= own
            self._destroyed.pop(node, None)
        else:
            self._keeping &= ~own
            self._destroyed[node] = 0b11 << owner >> 2  # it may have begun in the turn before

    def among(self, nodes: int) -> int:
        """Those of a set of neighbors that are in step, and whose frames none of the others destroys."""
        destroyed = reduce(or_, (those for node, those in self._destroyed.items() if nodes >> (node - 1) & 1), 0)
        return nodes & self._keeping & ~destroyed
