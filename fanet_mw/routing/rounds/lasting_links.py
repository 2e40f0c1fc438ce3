"""Which neighbors will stay within range long enough for a bound to count on them.

Each hello says where its sender is and how fast it flies. Two nodes that fly on straight lose each other when their
distance exceeds the range (link expiration time; Su, Lee and Gerla, 2001). Nodes that hardly recede from each other are
taken to stay, and so is one whose position is not known.
"""

from typing import Final

from fanet_mw.motion import Motion
from fanet_mw.units import Enu, NodeId, S

_RECEDING_M_S: Final = 1.0
"""Speeds below this are errors of positioning."""
_AGAIN: Final = 1.5
"""A link that was given up counts again when it will last so many times as long."""


class LastingLinks:
    """The links of one node that will last."""

    def __init__(self, *, range_m: float, horizon_ns: int) -> None:
        """`horizon_ns`: how long a link must last to count."""
        self._range_m = range_m
        self._horizon_ns = horizon_ns
        self._motions: dict[NodeId, Motion] = {}
        self._given_up = 0

    def hear(self, node: NodeId, motion: Motion) -> None:
        """A neighbor has told where it is."""
        self._motions[node] = motion

    def among(self, near: int, own: Motion) -> int:
        """Those of a set of neighbors whose links will last, if this node flies on as it does now."""
        lasting = near
        for node, motion in self._motions.items():
            bit = 1 << (node - 1)
            if near & bit and not self._lasts(motion, own, again=bool(self._given_up & bit)):
                lasting &= ~bit
        self._given_up = near & ~lasting
        return lasting

    def gone(self, near: int, own: Motion) -> int:
        """Those of a set of neighbors that are out of range already, as they flew when they were last heard."""
        found = 0
        for node, motion in self._motions.items():
            bit = 1 << (node - 1)
            if near & bit and motion.offset_from(own.position, own.at_ns).norm() > self._range_m:
                found |= bit
        return found

    def _lasts(self, motion: Motion, own: Motion, *, again: bool) -> bool:
        here = motion.offset_from(own.position, own.at_ns)
        v, w = motion.velocity, own.velocity
        drift = Enu(v.east - w.east, v.north - w.north, v.up - w.up)
        distance_m = here.norm()
        receding_m_s = (here.east * drift.east + here.north * drift.north + here.up * drift.up) / max(distance_m, 1.0)
        seconds = self._horizon_ns / S * (_AGAIN if again else 1.0)
        later = Enu(here.east + drift.east * seconds, here.north + drift.north * seconds, here.up + drift.up * seconds)
        return later.norm() <= self._range_m or (distance_m <= self._range_m and receding_m_s < _RECEDING_M_S)
