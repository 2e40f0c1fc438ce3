"""Connectivity maintenance: half-planes of velocities that keep a UAV in radio reach of others, and whom it seeks.

A UAV is tied to those whose places are beside its own. On the way to the places it is tied to neighbors whose links
will last, and rows give way to UAVs that respond (`_give_way`). When the swarm has come apart it seeks the other part.
"""

import math
from collections.abc import Collection, Sequence
from typing import Final

from agents.mission.navigation.half_planes import HalfPlane, Velocity
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.lasting_links import LASTING
from agents.mission.search_formation.pattern import Pattern
from agents.mission.search_formation.search_place import SearchPlace
from agents.mission.tasking.bidding import Bidding
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.search_plan import Search

_TETHER: Final = 0.95
"""The greatest distance of two UAVs that must stay connected, as a share of the radio's reach."""
_TETHER_S: Final = 2.0
"""A UAV may use up the rest of that distance in this time at the earliest."""
_CLOSING: Final = 0.97
_CLOSING_S: Final = 1.0
"""The same two while ranks are closed over a lost UAV, and every second counts."""
_FOLLOWS: Final = 0.88
"""While the swarm is apart a UAV keeps within this share of the reach of a neighbor that is fewer ties away from the
other part. So a whole row turns back with the UAV at its end.
"""
_LED: Final = 0.8
"""Before the sweep a UAV keeps within this share of the reach of a neighbor that responds, unless it is itself the
first at a survivor: otherwise the responder would be held where its links end, before it sees the survivor.
"""
_LED_PER_HOP: Final = 0.04
_LED_HOPS: Final = 4
"""A UAV up to so many hops from the responder keeps in reach of neighbors that are nearer to it. The share of the reach
grows by this with each hop: a whole row gives way a little, where one UAV alone would hold the responder back.
"""
_HASTE: Final = 0.95
"""A UAV flies back into such a limit at this share of its greatest speed at most."""
_HURRIES: Final = 0.9
_SETS_OUT_S: Final = 2.0
"""A UAV beyond a gap is expected to set out so long after the loss, at `_HURRIES` of its greatest speed."""
_UNSURE: Final = 0.7
"""A UAV of another part may be late on its way. One that should be within this share of the reach and is not heard is
not sought where it should be.
"""
_KEPT_M_S: Final = 1e-6
"""A velocity keeps to a limit up to this rounding error."""
_EARLY_TIES: Final = 2
"""A UAV that hears nobody to whom it is tied, because it has no plan or those beside it come late, stays connected with
so many of its nearest neighbors.
"""
_STRONG: Final = 0.75
"""A link is strong if it is now, and will be at the places, shorter than this share of the radio's reach."""


class ConnectivityMaintenance:
    """The limits of one UAV's velocity that keep it in reach of others, and the UAVs that it seeks."""

    def __init__(
        self,
        own_motion: OwnMotion,
        neighbors: NeighborMotions,
        formation: SearchPlace,
        bidding: Bidding,
        *,
        reach_m: float,
        speed_m_s: float,
    ) -> None:
        self._own_motion, self._neighbors = own_motion, neighbors
        self._formation, self._bidding = formation, bidding
        self._reach_m, self._haste_m_s = reach_m, _HASTE * speed_m_s
        self._ties: list[tuple[NodeId, HalfPlane]] = []
        """The UAVs in reach to which this one is tied, and the limits of its velocity that keep it there."""

    def planes(self, now_ns: int) -> list[HalfPlane]:
        """The limits of the velocity, those of the longest links first, because the last ones are dropped if they
        contradict others: a near neighbor that flies away must not draw this UAV off one that stays.
        """
        self._ties = []
        formation = self._formation
        if (formation.plan is not None and formation.place is None) or self._bidding.is_absent(now_ns):
            return []
        planes, closer, closes = [], [], formation.closing_s(now_ns) is not None
        ties = self._tied(now_ns)
        leading = [node for node in ties if formation.leads_to_gap(node, now_ns)]
        offsets = {node: motion.offset_from(self._own_motion.position, now_ns) for node, motion in ties.items()}
        for node, offset in sorted(offsets.items(), key=lambda tie: -tie[1].norm()):
            motion = ties[node]
            follows = leading == [node]  # between two gaps it would draw the sides together
            share, within_s = (_CLOSING, _CLOSING_S) if closes or follows else (_TETHER, _TETHER_S)
            plane = self._plane(offset, motion.velocity, share, within_s)
            if plane is not None:
                planes.append(plane)
                if offset.norm() <= _CLOSING * self._reach_m:
                    self._ties.append((node, plane))
            if follows:
                nearer = self._plane(offset, motion.velocity, _FOLLOWS, _CLOSING_S)
                closer += [] if nearer is None else [nearer]
        closer += self._give_way(ties, offsets, now_ns)
        return planes + closer  # who cannot follow so close stays in reach

    def _give_way(self, ties: dict[NodeId, Motion], offsets: dict[NodeId, Enu], now_ns: int) -> list[HalfPlane]:
        """The limits that draw this UAV after responders before the sweep, so that it does not hold them back where
        their links end. A UAV without a task gives way to all, one that is not the first at its survivor to those that
        are the first at theirs, and one that is the first to nobody.
        """
        if self._formation.is_taken_up(now_ns) or self._bidding.is_first(now_ns):
            return []
        responding = self._bidding.responders(now_ns, first=self._bidding.survivor is not None)
        responders_at = [at for at in map(self._formation.last_seen, responding) if at is not None]
        planes = []
        for node in sorted(ties):
            share = _LED if node in responding else self._share_led(ties[node], offsets[node], responders_at, now_ns)
            if share is not None:
                planes.append(self._plane(offsets[node], ties[node].velocity, share, _CLOSING_S))
        return [plane for plane in planes if plane is not None]

    def _share_led(self, motion: Motion, offset: Enu, responders_at: Sequence[Enu], now_ns: int) -> float | None:
        """The share of the reach within which this UAV keeps to a neighbor that is nearer to a responder, which may be
        out of reach itself; None if it need not.
        """
        if offset.horizontal() < _LED * self._reach_m:
            return None
        here, there = self._own_motion.position, motion.position_at(now_ns)
        ways_m = [(here.horizontal_to(at), there.horizontal_to(at)) for at in responders_at]
        hops = [math.ceil(own_m / self._reach_m) for own_m, left_m in ways_m if left_m < own_m]
        least = min((count for count in hops if 1 < count <= _LED_HOPS), default=None)
        return None if least is None else _LED + _LED_PER_HOP * (least - 1)

    def _plane(self, offset: Enu, velocity: Enu, share: float, within_s: float) -> HalfPlane | None:
        """The limit that keeps this UAV within a share of the reach of another one."""
        return tether_plane(
            offset,
            (velocity.east, velocity.north),
            tether_m=share * self._reach_m,
            within_s=within_s,
            haste_m_s=self._haste_m_s,
        )

    def _tied(self, now_ns: int) -> dict[NodeId, Motion]:
        """The UAVs in whose reach this one stays."""
        plan, pattern, place = self._formation.plan, self._formation.pattern, self._formation.place
        ties: dict[NodeId, Motion] = {}
        if plan is not None and pattern is not None and place is not None:
            is_settled = self._formation.is_settled(now_ns)
            if not is_settled:  # those who come late have no other ties yet
                ties = self._lasting(plan, pattern, place, now_ns)
            if self._formation.is_taken_up(now_ns):
                places = self._tied_to(pattern, place, now_ns)
                motions = {
                    NodeId(plan.nodes[at]): self._neighbors.motion(plan.nodes[at], now_ns=now_ns) for at in places
                }
                ties |= {node: motion for node, motion in motions.items() if motion is not None}
                late = [node for node, motion in motions.items() if motion is None]
                if late and not is_settled:
                    ties |= self._towards(late, now_ns)
                if not places and pattern.kind(place) != "follower":
                    return ties  # as in a circuit, where nobody keeps in reach of others
        return (ties or self._nearest_motions(now_ns)) | self._across(now_ns)

    def _towards(self, late: Collection[NodeId], now_ns: int) -> dict[NodeId, Motion]:
        """For each UAV that this one does not hear yet, though their places are side by side: the neighbor nearest to
        it, so that the row does not fly away from it.
        """
        present, here, found = self._present(now_ns), self._own_motion.position, dict[NodeId, Motion]()
        for node in late:
            at = self._formation.last_seen(node)
            if at is not None:
                near = [(motion.position_at(now_ns).horizontal_to(at), other) for other, motion in present.items()]
                left_m, nearest = min(near, default=(math.inf, node))
                if left_m < here.horizontal_to(at):
                    found[nearest] = present[nearest]
        return found

    def _across(self, now_ns: int) -> dict[NodeId, Motion]:
        """The nearest neighbor in reach that belongs to another part of the swarm, so that the parts stay linked."""
        here, present = self._own_motion.position, self._present(now_ns)
        others = {
            node: motion.offset_from(here, now_ns).norm()
            for node, motion in present.items()
            if node in self._formation.sought
        }
        near = [(left_m, node) for node, left_m in others.items() if left_m <= self._reach_m]
        return {min(near)[1]: present[min(near)[1]]} if near else {}

    def held(self, velocity: Enu) -> list[NodeId]:
        """The UAVs that stay in reach because the chosen velocity keeps to their limits."""
        return [node for node, plane in self._ties if plane.allows((velocity.east, velocity.north), but=_KEPT_M_S)]

    def beyond_gap(self, now_ns: int) -> Motion | None:
        """The likely motion of a UAV to be sought: of one beyond a lost one, while too far away to be heard, or of one
        in another part of the swarm. None if there is none.
        """
        away = [(left_m, motion) for left_m, _, motion in self._unheard(now_ns) if left_m > _CLOSING * self._reach_m]
        return min(away)[1] if away else self._parted(now_ns)

    def missed(self, now_ns: int) -> int | None:
        """In the sweep: a UAV beyond a lost one that this one would hear by now if both had hurried to close ranks. It
        is lost, too; None if there is none.
        """
        since_s = (self._formation.closing_s(now_ns) or 0.0) - _SETS_OUT_S
        if since_s <= 0 or not self._formation.is_taken_up(now_ns):
            return None  # on the way to the places nobody knows well enough where another one should be
        near_m = _CLOSING * self._reach_m + _HURRIES * self._haste_m_s * since_s
        return next((node for left_m, node, _ in self._unheard(now_ns) if left_m <= near_m), None)

    def _unheard(self, now_ns: int) -> list[tuple[float, int, Motion]]:
        """The UAVs to which this one is tied and which it does not hear while ranks are closed: the distance, the node
        and the motion of each. The motion is the one without the loss; before the sweep it is the likely one.
        """
        plan, pattern, place = self._formation.plan, self._formation.pattern, self._formation.place
        closing_s, swept_s = self._formation.closing_s(now_ns), self._formation.swept_s(now_ns)
        if plan is None or pattern is None or place is None or closing_s is None:
            return []
        if self._bidding.is_absent(now_ns) or pattern.may_leave(place, swept_s or 0.0):
            return []
        missing = [
            other
            for other in pattern.tethers(place, swept_s or 0.0)
            if self._neighbors.motion(plan.nodes[other], now_ns=now_ns) is None
        ]
        if swept_s is None:
            motions = self._formation.likely_ways(missing, now_ns)
        else:
            motions = {at: Motion(*self._formation.known_at(at, swept_s), now_ns) for at in missing}
        here = self._own_motion.position
        return [(here.horizontal_to(way.position), plan.nodes[at], way) for at, way in motions.items()]

    def _parted(self, now_ns: int) -> Motion | None:
        """The motion of a UAV of another part that this one seeks on the way to the places, because their places are in
        reach of each other, and no neighbor is nearer to such a UAV. None if there is none, or it is heard in reach.
        """
        place, pattern, plan = self._formation.place, self._formation.pattern, self._formation.plan
        ways = {} if place is None or self._bidding.is_absent(now_ns) else self._formation.parted_ways(now_ns)
        if not ways or plan is None or pattern is None or place is None:
            return None
        ends = {other: pattern.at(other, 0.0) for other in ways}
        heard = {other: self._neighbors.motion(plan.nodes[other], now_ns=now_ns) for other in ways}

        def nearest(end: Enu, at: Enu) -> tuple[float, int]:
            found = [(math.inf, -1)]
            for other, way in ways.items():
                left_m = (heard[other] or way).offset_from(at, now_ns).horizontal()
                is_there = heard[other] is not None or left_m > _UNSURE * self._reach_m
                if is_there and ends[other].horizontal_to(end) <= LASTING * self._reach_m:
                    found.append((left_m, other))
            return min(found)

        near_m, sought = nearest(pattern.at(place, 0.0), self._own_motion.position)
        if sought < 0 or (heard[sought] is not None and near_m <= _CLOSING * self._reach_m):
            return None
        place_of = {node: at for at, node in enumerate(plan.nodes) if at not in pattern.vacant and at not in ways}
        for node, motion in self._present(now_ns).items():
            if node in place_of:
                other_m, _ = nearest(pattern.at(place_of[node], 0.0), motion.position_at(now_ns))
                if other_m < near_m:
                    return None
        return heard[sought] or ways[sought]

    def _lasting(self, plan: Search, pattern: Pattern, place: int, now_ns: int) -> dict[NodeId, Motion]:
        """The neighbors whose places are in reach of this UAV's. Left out are those that a third UAV connects with it
        by two links that are strong and shorter; a link that is too long now counts, because it is drawn in again.
        """
        swept_s, place_of = self._formation.swept_s(now_ns) or 0.0, {node: at for at, node in enumerate(plan.nodes)}
        present = {node: motion for node, motion in self._present(now_ns).items() if node in place_of}
        here = (self._own_motion.position, pattern.at(place, swept_s))
        ends = {
            node: (motion.position_at(now_ns), pattern.at(place_of[node], swept_s)) for node, motion in present.items()
        }
        links_m = {node: _longest_m(here, there) for node, there in ends.items()}
        lasting = [node for node, at in ends.items() if at[1].horizontal_to(here[1]) <= LASTING * self._reach_m]

        def is_spared(node: NodeId) -> bool:
            most_m = min(links_m[node], _STRONG * self._reach_m)
            return any(links_m[third] < most_m and _longest_m(ends[third], ends[node]) < most_m for third in lasting)

        return {node: present[node] for node in lasting if not is_spared(node)}

    def _nearest_motions(self, now_ns: int) -> dict[NodeId, Motion]:
        """The nearest neighbors (`_EARLY_TIES`)."""
        here, present = self._own_motion.position, self._present(now_ns)
        nearest = sorted(present, key=lambda node: present[node].offset_from(here, now_ns).norm())
        return {node: present[node] for node in nearest[:_EARLY_TIES]}

    def _present(self, now_ns: int) -> dict[NodeId, Motion]:
        """The neighbors without those that may have left the formation for a survivor."""
        absent = self._bidding.responders(now_ns) if self._bidding.may_be_absent else ()
        return {NodeId(node): motion for node, motion in self._neighbors.by_node(now_ns=now_ns) if node not in absent}

    def _tied_to(self, pattern: Pattern, place: int, now_ns: int) -> tuple[int, ...]:
        """The places in whose reach this UAV stays: those to which its place is tied; if its place may be left, that of
        the nearest UAV of its team.
        """
        swept_s = self._formation.swept_s(now_ns) or 0.0
        if pattern.may_leave(place, swept_s):
            return self._nearest(pattern.line(place), now_ns)
        return pattern.tethers(place, swept_s)

    def _nearest(self, places: range, now_ns: int) -> tuple[int, ...]:
        """Of these places the one whose UAV is nearest to this one; empty if none of their UAVs is a neighbor."""
        plan = self._formation.plan
        assert plan is not None, "who has a place has a plan"
        near = [
            (motion.offset_from(self._own_motion.position, now_ns).norm(), other)
            for other in places
            if (motion := self._neighbors.motion(plan.nodes[other], now_ns=now_ns)) is not None
        ]
        return (min(near)[1],) if near else ()


def _longest_m(a: tuple[Enu, Enu], b: tuple[Enu, Enu]) -> float:
    """The distance of two UAVs, each given by its position and its place, or that of their places if it is greater."""
    return max(a[0].horizontal_to(b[0]), a[1].horizontal_to(b[1]))


def tether_plane(
    offset: Enu, other_velocity: Velocity, *, tether_m: float, within_s: float, haste_m_s: float = math.inf
) -> HalfPlane | None:
    """The half-plane of velocities that keep this UAV within `tether_m` of another for `within_s`; None if the other is
    so near that it needs none. Each of both may use half of the distance that is left; if they are too far apart this
    UAV makes up for that alone, at `haste_m_s` at most.
    """
    distance = offset.horizontal()
    if distance < 0.3 * tether_m:
        return None
    nx, ny = offset.east / distance, offset.north / distance
    slack_m = tether_m - distance
    parting = (slack_m / within_s) * (0.5 if slack_m > 0 else 1.0)
    return HalfPlane(nx, ny, min(haste_m_s, other_velocity[0] * nx + other_velocity[1] * ny - parting))
