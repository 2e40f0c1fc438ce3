"""Connectivity maintenance: half-planes of velocities that keep a UAV within radio reach of those it is tied to."""

import math
from collections.abc import Collection, Sequence
from typing import Final

from agents.mission.navigation.half_planes import HalfPlane, Velocity
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.formation_place import FormationPlace
from agents.mission.search_formation.lasting_links import LASTING
from agents.mission.search_formation.pattern import Pattern
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
"""The same two while ranks are closed over somebody who is lost, and every second counts."""
_FOLLOWS: Final = 0.88
"""The greatest distance, as such a share, of one that is nearer to a gap while the swarm is apart: a line waits and
turns back for its chain rather than hold it back.
"""
_LED: Final = 0.8
"""Before the sweep a UAV without a task keeps within this share of the reach of a neighbor that responds: otherwise the
responder would be held where its links end, before it sees the survivor.
"""
_LED_PER_HOP: Final = 0.04
_LED_HOPS: Final = 4
"""A UAV up to so many hops from the responder keeps within so much more of the reach, for each hop, of neighbors that
are nearer to it: a whole row gives way a little, where one alone would hold the responder back.
"""
_HASTE: Final = 0.95
"""Whoever is too far away for that is approached at this share of the greatest speed."""

_HURRIES: Final = 0.9
_SETS_OUT_S: Final = 2.0
"""Who is beyond a gap has noticed the loss after this time, and flies here at this share of the speed for that."""
_UNSURE: Final = 0.7
"""Who is on the way may be late: it is sought up to this share of the reach from where it should be, until it is heard.
"""

_KEPT_M_S: Final = 1e-6
"""A velocity keeps to a limit up to this rounding error."""
_EARLY_TIES: Final = 2
"""A UAV that hears nobody to whom it is tied, because it has no plan or those beside it come late, stays connected with
so many of its nearest neighbors."""
_STRONG: Final = 0.75
"""A link is strong if it is now, and will be at the places, shorter than this share of the radio's reach."""


class ConnectivityMaintenance:
    """Keeps a UAV of a team, or a relay, in reach of the places to which it is tied (`Shape.tethers`), a follower in
    reach of its team's nearest UAV, and all on the way to their places in reach of links that last. Who hears none of
    these, or has no plan, stays in reach of its nearest neighbors.
    """

    def __init__(
        self,
        own_motion: OwnMotion,
        neighbors: NeighborMotions,
        formation: FormationPlace,
        bidding: Bidding,
        *,
        reach_m: float,
        speed_m_s: float,
    ) -> None:
        self._own_motion, self._neighbors = own_motion, neighbors
        self._formation, self._bidding = formation, bidding
        self._reach_m, self._haste_m_s = reach_m, _HASTE * speed_m_s
        self._ties: list[tuple[NodeId, HalfPlane]] = []
        """The UAVs in reach to which this one is tied, and the limits that keep it there."""

    def planes(self, now_ns: int) -> list[HalfPlane]:
        """The limits of the longest links first: of those that contradict each other the last are dropped, and a
        neighbor that goes away must not draw this UAV off one that stays.
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
        closer += self._led(ties, offsets, now_ns)
        return planes + closer  # who cannot follow so close stays in reach

    def _led(self, ties: dict[NodeId, Motion], offsets: dict[NodeId, Enu], now_ns: int) -> list[HalfPlane]:
        """The limits before the sweep that keep a UAV without a task near those who respond, and those who follow, and
        one that responds after others near those who arrive first at some survivor: it would hold them back where
        their links end.
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
        """The share of the reach within which this UAV keeps to a neighbor because that is nearer to one that responds,
        which may be out of reach; None if it need not.
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
        """Those within whose reach this UAV stays."""
        plan, pattern, place = self._formation.plan, self._formation.pattern, self._formation.place
        ties: dict[NodeId, Motion] = {}
        if plan is not None and pattern is not None and place is not None:
            is_settled = self._formation.is_settled(now_ns)
            if not is_settled:  # links that last hold those who come late
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
        """The neighbor nearest to each UAV beside which this one has its place and which it does not hear yet: a row
        that did not stay with it would fly away alone.
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
        """The nearest neighbor in another part of the swarm: the only link to it that this UAV has, and would lose."""
        here, present = self._own_motion.position, self._present(now_ns)
        others = {
            node: motion.offset_from(here, now_ns).norm()
            for node, motion in present.items()
            if node in self._formation.sought
        }
        near = [(left_m, node) for node, left_m in others.items() if left_m <= self._reach_m]
        return {min(near)[1]: present[min(near)[1]]} if near else {}

    def held(self, velocity: Enu) -> list[NodeId]:
        """Those who stay in reach because the velocity that was chosen keeps to their limits."""
        return [node for node, plane in self._ties if plane.allows((velocity.east, velocity.north), but=_KEPT_M_S)]

    def beyond_gap(self, now_ns: int) -> Motion | None:
        """The likely motion of a UAV beyond a lost one, which hurries here; None once this UAV would hear it there."""
        away = [(left_m, motion) for left_m, _, motion in self._unheard(now_ns) if left_m > _CLOSING * self._reach_m]
        return min(away)[1] if away else self._parted(now_ns)

    def missed(self, now_ns: int) -> int | None:
        """A UAV beyond a lost one that this one would hear by now if it had hurried here, too: it is lost as well."""
        since_s = (self._formation.closing_s(now_ns) or 0.0) - _SETS_OUT_S
        if since_s <= 0:
            return None
        near_m = _CLOSING * self._reach_m + _HURRIES * self._haste_m_s * since_s
        return next((node for left_m, node, _ in self._unheard(now_ns) if left_m <= near_m), None)

    def _unheard(self, now_ns: int) -> list[tuple[float, int, Motion]]:
        """Those to whom this UAV is tied and whom it does not hear while ranks are closed, each with its motion before
        the loss and how far away that is.
        """
        plan, pattern, place = self._formation.plan, self._formation.pattern, self._formation.place
        closing_s, swept_s = self._formation.closing_s(now_ns), self._formation.swept_s(now_ns)
        if plan is None or pattern is None or place is None or closing_s is None or swept_s is None:
            return []
        if self._bidding.is_absent(now_ns) or pattern.may_leave(place, swept_s):
            return []
        unheard = []
        for other in pattern.tethers(place, swept_s):
            if self._neighbors.motion(plan.nodes[other], now_ns=now_ns) is None:
                at, velocity = self._formation.known_at(other, swept_s)
                left_m = self._own_motion.position.horizontal_to(at)
                unheard.append((left_m, plan.nodes[other], Motion(at, velocity, now_ns)))
        return unheard

    def _parted(self, now_ns: int) -> Motion | None:
        """The motion of a UAV of another part that this one seeks on the way to the places: the places are in reach of
        each other, so a link lasts, and no neighbor is nearer to any such UAV. None once it is heard in reach.
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
        """Neighbors whose places are in reach of this UAV's; not one with whom a third has strong links to both, each
        shorter. A link stretched on the way is drawn in again: given up there, it would be when it matters most.
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
        here, present = self._own_motion.position, self._present(now_ns)
        nearest = sorted(present, key=lambda node: present[node].offset_from(here, now_ns).norm())
        return {node: present[node] for node in nearest[:_EARLY_TIES]}

    def _present(self, now_ns: int) -> dict[NodeId, Motion]:
        """The neighbors but those that may have left the others for a survivor."""
        absent = self._bidding.responders(now_ns) if self._bidding.may_be_absent else ()
        return {NodeId(node): motion for node, motion in self._neighbors.by_node(now_ns=now_ns) if node not in absent}

    def _tied_to(self, pattern: Pattern, place: int, now_ns: int) -> tuple[int, ...]:
        """Places in whose reach this UAV stays: tied ones, past one that may leave; else its team's nearest UAV."""
        swept_s = self._formation.swept_s(now_ns) or 0.0
        if pattern.may_leave(place, swept_s):
            return self._nearest(pattern.line(place), now_ns)
        return pattern.tethers(place, swept_s)

    def _nearest(self, places: range, now_ns: int) -> tuple[int, ...]:
        """Of these places, the one whose holder is nearest to this UAV; empty if no holder was received recently."""
        plan = self._formation.plan
        assert plan is not None, "who has a place has a plan"
        near = [
            (motion.offset_from(self._own_motion.position, now_ns).norm(), other)
            for other in places
            if (motion := self._neighbors.motion(plan.nodes[other], now_ns=now_ns)) is not None
        ]
        return (min(near)[1],) if near else ()


def _longest_m(a: tuple[Enu, Enu], b: tuple[Enu, Enu]) -> float:
    """The distance of two UAVs, each given by its position and its place, or of their places if that is greater."""
    return max(a[0].horizontal_to(b[0]), a[1].horizontal_to(b[1]))


def tether_plane(
    offset: Enu, other_velocity: Velocity, *, tether_m: float, within_s: float, haste_m_s: float = math.inf
) -> HalfPlane | None:
    """The half-plane of velocities that keep this UAV within `tether_m` of another for `within_s`; None if it needs
    none. Each may use half of the distance that is left; without any this UAV alone makes up for it, at `haste_m_s` at
    most.
    """
    distance = offset.horizontal()
    if distance < 0.3 * tether_m:
        return None
    nx, ny = offset.east / distance, offset.north / distance
    slack_m = tether_m - distance
    parting = (slack_m / within_s) * (0.5 if slack_m > 0 else 1.0)
    return HalfPlane(nx, ny, min(haste_m_s, other_velocity[0] * nx + other_velocity[1] * ny - parting))
