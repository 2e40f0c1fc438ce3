"""A UAV's place in the formation: where the plan wants it at each instant, and how far it may go from there.

Teams and relays connect the swarm, so they stay near their places; a follower may fly anywhere near its team
(`shapes/contract.py` explains the words).
"""

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Final

from agents.mission.finding.phone_localization import Estimate
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.formation_planner import pattern_of
from agents.mission.search_formation.pattern import Pattern
from agents.mission.search_formation.shapes.contract import BACK
from agents.mission.search_formation.ways_there import detours
from fanet_mw.motion import Motion
from fanet_mw.units import MS, STILL, US, Enu, NodeId, S
from fanet_mw.wire.search_plan import Search

_FREE_REACH: Final = 0.84
"""A follower stays within this share of the radio's reach from its team."""
_ASIDE_M: Final = 70.0
"""A UAV of a team examines a survivor who is at most so far beside the strip of `_LEASH_M` in which it may fly, or as
far as its camera shows if that is less.
"""
_LOOK_SHARE: Final = 0.9
"""The share of its view to the side that a UAV relies on."""
_AHEAD_M: Final = 350.0
"""A UAV of a team examines a survivor who is at most this far ahead of its place."""
_LEAD_M: Final = 120.0
"""A UAV of a team flies at most this far ahead of its place for a survivor to whom it was sent."""
_LEASH_M: Final = 58.0
"""The greatest distance to the side at which a UAV of a team, or a relay, may be from its place."""
_LAG_M: Final = 140.0
"""The greatest distance by which a UAV of a team, or a relay, may be behind its place, and on all sides of one that
rests.
"""
_NEARLY_M: Final = 120.0
"""A UAV is nearly at a survivor whose estimate is this near to it and not vague. In the sweep it finishes that flight,
even if it has lost the auction meanwhile.
"""
_ENDS_M: Final = 200.0
"""It does so while it is at most this far from its own place: its row waits for it, or closes ranks without it."""
_COMES_M: Final = 300.0
"""The same distance until all have settled: a UAV may still be on its way to its place."""
_SETTLED_NS: Final = 20 * S
"""So long after the sweep has begun everybody is taken to be at its place."""
_CLOSES_S: Final = 15.0
"""The time within which ranks are closed."""
_APART_S: Final = 40.0
"""For so long after a loss, while the swarm is apart, a UAV follows a neighbor fewer ties away from another part."""
_USED: Final = 0.9
"""The share of the time on the way to the places that detours may take, at the speed of the way back."""
_FLOWN_NS: Final = 8 * S
"""So long after they began to close ranks most UAVs are at their new places."""


class SearchPlace:
    """The place of one UAV in the plan that it follows."""

    def __init__(self, node: NodeId, own_motion: OwnMotion, *, reach_m: float, look_m: float = math.inf) -> None:
        """`look_m`: how far to the side of the UAV its camera shows people on the ground."""
        self._node = node
        self._own_motion = own_motion
        self._reach_m, self._most_m = reach_m, _FREE_REACH * reach_m
        self._view_m = 0.0 if math.isinf(look_m) else _LOOK_SHARE * look_m
        """How far to the side the camera is relied on; 0 for a UAV without one."""
        self._aside_m = min(_ASIDE_M, _LOOK_SHARE * look_m)
        self.plan: Search | None = None
        self.pattern: Pattern | None = None
        self.place: int | None = None
        self._left_from: Enu | None = None
        """Where this UAV was when it received its first plan, or had taken off after that."""
        self._left_ns = 0
        """The instant at which it leaves that position."""
        self._is_first = True
        """Whether the plan has the first formation that this UAV knows, and not another one after losses."""
        self._over: dict[int, tuple[Enu, int]] = {}
        """Over which place on the way to the first formation the UAV of a place flies, and when; most fly straight."""
        self._gaps: frozenset[int] = frozenset()
        """The places of lost UAVs."""
        self._parted: Collection[int] = ()
        """The UAVs of another part of the swarm, out of reach and not lost."""
        self.sought: Collection[int] = ()
        """The same. While ranks are closed, those that were in another part last are kept: parts that meet by a chance
        link may lose each other again.
        """
        self._seen: dict[int, tuple[Enu, int]] = {}
        """Where each other UAV was, by its latest hello or status, and when."""
        self._closing_ns = 0
        """The instant at which this UAV learned of the latest loss."""
        self._lost_at: dict[int, Enu] = {}
        """Where each UAV lost in the sweep was due when this one learned of it, above ground."""
        self._hops: Mapping[int, int] = {}
        """How many ties lead from each place to the nearest one of another part."""
        self._before: Pattern | None = None
        """The last formation before a loss that all had time to take up."""
        self._changed_ns = -_FLOWN_NS
        """The instant at which the UAVs began to close ranks the last time, or to open them."""

    def adopt(self, plan: Search, now_ns: int) -> None:
        """Follow a plan from now on."""
        made, before = pattern_of(plan, reach_m=self._reach_m), self.pattern
        first = self.place is None or before is None or before.dimensions != made.dimensions
        self._is_first &= before is None or before.dimensions == made.dimensions
        self.plan, self.pattern = plan, made
        self.place = plan.nodes.index(self._node) if self._node in plan.nodes else None
        if first:
            self._before = None
            self.depart(now_ns)

    def close_ranks(
        self, lost: Collection[int], now_ns: int, *, away: Collection[int] = (), parted: Collection[int] = ()
    ) -> None:
        """Fly on without the lost UAVs and without those that left the search (`away`), for whom nobody hurries;
        `parted`: those in another part of the swarm, which are not lost.
        """
        if self.plan is None or self.pattern is None:
            return
        vacant = frozenset(
            place
            for place, node in enumerate(self.plan.nodes)
            if node != self._node and (not node or node in lost or node in away)
        )
        if len(vacant) >= len(self.plan.nodes) - 1:
            vacant = frozenset()  # it is alone, and waits for the others at its place
        if parted or now_ns - self._closing_ns > _CLOSES_S * S:
            self.sought = parted
        gaps = frozenset(
            place for place in vacant if self.plan.nodes[place] in lost and self.plan.nodes[place] not in away
        )
        if parted != self._parted:
            self._parted = parted
            self._hops = self.pattern.hops_from([at for at, node in enumerate(self.plan.nodes) if node in parted])
        if not gaps <= self._gaps:
            self._closing_ns = now_ns
            swept_s = self.swept_s(now_ns)
            if swept_s is not None:
                fresh = gaps - self._gaps
                self._lost_at |= {self.plan.nodes[place]: self.pattern.at(place, swept_s) for place in fresh}
            if now_ns - self._changed_ns >= _FLOWN_NS:
                self._before = self.pattern
        self._gaps = gaps
        if vacant != self.pattern.vacant:
            self.pattern, self._changed_ns = self.pattern.closed(vacant), now_ns

    def lost_at(self, now_ns: int) -> Mapping[int, Enu]:
        """Where the UAVs lost in the sweep should have been then. The ground there is taken to be as high as that below
        this UAV.
        """
        rise_m = self._own_motion.position.up - self._own_motion.height_m(now_ns)
        return {node: at._replace(up=at.up + rise_m) for node, at in self._lost_at.items()}

    def closing_s(self, now_ns: int) -> float | None:
        """How long the row of this UAV has been closing ranks since the latest loss; None if it does not, or has."""
        since_s = (now_ns - self._closing_ns) / S
        if self.pattern is None or self.place is None or not self._gaps or since_s > _CLOSES_S:
            return None
        return since_s if self.pattern.has_beside(self.place, self._gaps) else None

    def leads_to_gap(self, node: int, now_ns: int) -> bool:
        """True, for some time after a loss, for a UAV whose place is fewer ties from another part of the swarm than the
        place of this one.
        """
        plan, hops = self.plan, self._hops
        if plan is None or now_ns - self._closing_ns > _APART_S * S:
            return False
        own = math.inf if self.place is None else hops.get(self.place, math.inf)
        return any(hops.get(place, math.inf) < own for place, holder in enumerate(plan.nodes) if holder == node)

    @property
    def passes_above(self) -> bool:
        """True for a UAV that must fly above its place, because UAVs beyond a gap that do not hear it may take it for
        lost and fly to its place. Only those on one side of a gap do so.
        """
        if self.pattern is None or self.place is None or not self._gaps:
            return False
        size, is_above = self.pattern.gap_beside(self.place, self._gaps)
        return is_above and size > (0 if self._parted else 1)

    def known_at(self, place: int, swept_s: float) -> tuple[Enu, Enu]:
        """The position and velocity that the UAV of a place would have without the latest loss: there it is sought."""
        pattern = self._before or self.pattern
        assert pattern is not None, "who seeks others has a plan"
        return pattern.at(place, swept_s), pattern.velocity(place, swept_s)

    def see(self, node: int, position: Enu, at_ns: int) -> None:
        """Another UAV has said that it was at a position at an instant."""
        if at_ns >= self._seen.get(node, (position, at_ns))[1]:
            self._seen[node] = position, at_ns

    def last_seen(self, node: int) -> Enu | None:
        """Where another UAV was by the latest that it said of itself; None if nothing came from it."""
        return self._seen[node][0] if node in self._seen else None

    def parted_ways(self, now_ns: int) -> dict[int, Motion]:
        """Before the sweep: the likely motion of each UAV of another part on the way to its place, by that place."""
        nodes = () if self.plan is None else self.plan.nodes
        return self.likely_ways([place for place, node in enumerate(nodes) if node in self.sought], now_ns)

    def likely_ways(self, places: Iterable[int], now_ns: int) -> dict[int, Motion]:
        """Before the sweep: the likely motion of the UAV of each of these places on the way to it, by what it said last
        of itself.
        """
        plan, pattern, ways = self.plan, self.pattern, dict[int, Motion]()
        if plan is None or pattern is None or self.is_taken_up(now_ns):
            return ways
        for place in places:
            seen = self._seen.get(plan.nodes[place])
            if seen is not None:
                start, seen_ns = seen
                from_ns, goal = max(seen_ns, plan.start_us * US), pattern.at(place, 0.0)
                at, velocity = _on_way(
                    start, goal, from_ns=from_ns, to_ns=_taken_up_ns(plan), now_ns=now_ns, over=self._over.get(place)
                )
                ways[place] = Motion(at, velocity, now_ns)
        return ways

    def depart(self, now_ns: int) -> None:
        """Set out for the place from where this UAV is, when the plan begins."""
        begins_ns = now_ns if self.plan is None else self.plan.start_us * US
        self._left_from, self._left_ns = self._own_motion.over_ground(now_ns), max(now_ns, begins_ns)
        self._over = self._detours() if self._is_first else {}

    def _detours(self) -> dict[int, tuple[Enu, int]]:
        plan, pattern, here = self.plan, self.pattern, self._left_from
        if plan is None or pattern is None or here is None or not self._view_m:
            return {}
        begins_ns, arrival_ns = plan.start_us * US, _taken_up_ns(plan)
        starts = {place: self._seen[node][0] for place, node in enumerate(plan.nodes) if node in self._seen}
        if self.place is not None:
            starts[self.place] = here
        most_m = _USED * BACK * plan.speed_m_s * (arrival_ns - begins_ns) / S
        found = {}
        for place, over in detours(pattern, starts, view_m=self._view_m, most_m=most_m).items():
            to_m, from_m = starts[place].horizontal_to(over), over.horizontal_to(pattern.at(place, 0.0))
            found[place] = over, begins_ns + round(to_m / (to_m + from_m) * (arrival_ns - begins_ns))
        return found

    def leave(self) -> None:
        """Give up the place, even if the plan still has it."""
        self.place = None

    # --- where the plan wants the UAV ----------------------------------------------------------------------------

    def is_free(self, now_ns: int) -> bool:
        """True for a UAV whose place the swarm does not need now to stay connected, and for one without a place."""
        pattern, place = self.pattern, self.place
        return pattern is None or place is None or pattern.may_leave(place, self.swept_s(now_ns) or 0.0)

    @property
    def searches(self) -> bool:
        """True for a UAV of a team, which has a lane to search."""
        return self.pattern is not None and self.place is not None and self.pattern.kind(self.place) == "line"

    def is_taken_up(self, now_ns: int) -> bool:
        """True once all UAVs have had time to fly to their places: the sweep has begun."""
        return self.plan is not None and now_ns >= _taken_up_ns(self.plan)

    def is_settled(self, now_ns: int) -> bool:
        """True once those that came late have had time to reach their places, too."""
        return self.is_taken_up(now_ns - _SETTLED_NS)

    def lane(self, now_ns: int) -> tuple[Enu, Enu]:
        """Where the plan wants this UAV now, at its height above ground, and with which velocity; before the sweep that
        is on the way to its place.
        """
        plan, pattern, place = self.plan, self.pattern, self.place
        if plan is None or pattern is None or place is None:
            return self._left_from or self._own_motion.over_ground(now_ns), STILL
        arrival_ns = _taken_up_ns(plan)
        if now_ns >= arrival_ns or self._left_from is None:
            swept_s = (now_ns - arrival_ns) / S
            return pattern.at(place, swept_s), pattern.velocity(place, swept_s)
        return _on_way(
            self._left_from, pattern.at(place, 0.0), from_ns=self._left_ns, to_ns=arrival_ns, now_ns=now_ns,
            over=self._over.get(place),
        )  # fmt: skip

    # --- how far it may go from there -----------------------------------------------------------------------------

    def leads_by(self, estimate: Estimate | None, lane: Enu, moves: Enu) -> bool:
        """True if a survivor can be examined without leaving the formation; `lane` and `moves` are of `lane()`."""
        if estimate is None:
            return False
        if moves == STILL:
            return estimate.distance_m(lane) <= _LAG_M + self._aside_m
        ahead_m, aside_m = along(moves, estimate.east_m - lane.east, estimate.north_m - lane.north)
        return abs(aside_m) <= _LEASH_M + self._aside_m and -_LAG_M <= ahead_m <= _AHEAD_M

    def is_nearly_at(self, estimate: Estimate | None) -> bool:
        """True if this UAV is nearly at the place of a survivor, and the estimate is not vague."""
        here = self._own_motion.position
        return estimate is not None and not estimate.is_vague and estimate.distance_m(here) <= _NEARLY_M

    def finishes(self, estimate: Estimate | None, now_ns: int) -> bool:
        """True in the sweep if this UAV is nearly at the place of a survivor, and not too far from its own place."""
        if not self.is_nearly_at(estimate) or not self.is_taken_up(now_ns):
            return False
        most_m = _ENDS_M if self.is_settled(now_ns) else _COMES_M
        return self.lane(now_ns)[0].horizontal_to(self._own_motion.position) <= most_m

    def is_near(self, now_ns: int) -> bool:
        """True if this UAV is as near to its place as the swarm needs it to stay connected."""
        lane, moves = self.lane(now_ns)
        here = self._own_motion.position
        if moves == STILL:
            return lane.horizontal_to(here) <= _LAG_M
        ahead_m, aside_m = along(moves, here.east - lane.east, here.north - lane.north)
        return abs(aside_m) <= _LEASH_M and abs(ahead_m) <= _LAG_M

    def strays(self, now_ns: int) -> bool:
        """True in the sweep for a UAV of a team that is too far from its place to hold its row together, if the swarm
        can do without that place: it left for a survivor, or comes late.
        """
        return self.searches and self.is_taken_up(now_ns) and self.is_free(now_ns) and not self.is_near(now_ns)

    def can_be_spared(self, now_ns: int) -> bool:
        """True if the others of its row can close ranks without this UAV, and the row stays as long as it is."""
        pattern, place, at_s = self.pattern, self.place, self.swept_s(now_ns)
        if pattern is None or place is None or at_s is None:
            return False
        closed = pattern.closed(pattern.vacant | {place})
        row = next((row for row in pattern.shape.rows() if place in row.places), None)
        return row is None or all(
            closed.shape.at(end, at_s) == pattern.shape.at(end, at_s) for end in (row.places[0], row.places[-1])
        )

    def misses_m(self, estimate: Estimate, lane: Enu, moves: Enu, now_ns: int) -> float:
        """How far from an estimated place this UAV must stop, because it may not leave its own; 0 if it gets there, or
        if lanes turn, so that it may come nearer later.
        """
        if self.is_free(now_ns) or self.pattern is None or self.pattern.dimensions.turns:
            return 0.0
        if moves == STILL:
            return max(0.0, estimate.distance_m(lane) - _LAG_M)
        ahead_m, aside_m = along(moves, estimate.east_m - lane.east, estimate.north_m - lane.north)
        return math.hypot(max(0.0, -_LAG_M - ahead_m), max(0.0, abs(aside_m) - _LEASH_M))

    def bounded(
        self, east: float, north: float, lane: Enu, moves: Enu, now_ns: int, *, leads: bool = False, views: bool = False
    ) -> tuple[Enu, Enu]:
        """The position nearest to a point at which this UAV may be, and the velocity of that position. `leads`: it may
        be ahead of its place, whose position and velocity are `lane` and `moves`; `views`: while its team moves,
        this UAV leaves its lane only as far as its camera needs to show the point.
        """
        if self.is_free(now_ns):
            return Enu(east, north, lane.up), STILL
        if moves == STILL:  # nothing is ahead, or behind
            left_m = math.hypot(east - lane.east, north - lane.north)
            share = min(1.0, _LAG_M / left_m) if left_m else 1.0
            return Enu(
                lane.east + share * (east - lane.east), lane.north + share * (north - lane.north), lane.up
            ), STILL
        ahead_m, aside_m = along(moves, east - lane.east, north - lane.north)
        if views:
            aside_m = math.copysign(max(0.0, abs(aside_m) - self._view_m), aside_m)
        aside_m = max(-_LEASH_M, min(_LEASH_M, aside_m))
        most_m = _LEAD_M if leads else 0.0
        if ahead_m >= most_m:  # it waits for its place to move there
            return _beside(lane, moves, most_m, aside_m), moves
        if ahead_m < -_LAG_M:
            return _beside(lane, moves, -_LAG_M, aside_m), moves
        return _beside(lane, moves, ahead_m, aside_m), STILL

    def holds_together(self, estimate: Estimate | None, now_ns: int, *, within_s: float) -> bool:
        """True if a UAV at an estimated place would be in reach of the team of this UAV `within_s` from now and 5 s
        later.
        """
        return estimate is not None and self.keeps_line(estimate.east_m, estimate.north_m, now_ns, within_s=within_s)

    def keeps_line(self, east_m: float, north_m: float, now_ns: int, *, within_s: float) -> bool:
        """True if this position is in reach of the team `within_s` from now and 5 s later; False before the sweep."""
        pattern, place, at_s = self.pattern, self.place, self.swept_s(now_ns)
        if pattern is None or place is None or at_s is None:
            return False
        team = pattern.dimensions.team_of(place)
        return all(
            pattern.shape.apart_m(team, east_m, north_m, at_s + ahead_s) <= self._most_m
            for ahead_s in (within_s, within_s + 5.0)
        )

    def beyond_reception_m(self, east_m: float, north_m: float, now_ns: int) -> float:
        """How far a position is out of reach of this UAV's team; before the sweep, of where the plan wants this UAV."""
        pattern, place, at_s = self.pattern, self.place, self.swept_s(now_ns)
        if pattern is None or place is None or at_s is None:
            lane, _ = self.lane(now_ns)
            apart_m = math.hypot(lane.east - east_m, lane.north - north_m)
        else:
            apart_m = pattern.shape.apart_m(pattern.dimensions.team_of(place), east_m, north_m, at_s)
        return max(0.0, apart_m - self._most_m)

    def sweep_starts_ns(self) -> int | None:
        """The instant at which the sweep begins, when all should be at their places; None without a plan."""
        return None if self.plan is None else _taken_up_ns(self.plan)

    def is_swept(self, now_ns: int, *, times: int) -> bool:
        """True once the formation has swept the area so often; the way back is a sweep, too."""
        pattern, swept_s = self.pattern, self.swept_s(now_ns)
        return pattern is not None and swept_s is not None and swept_s >= times * pattern.shape.sweep_s

    def swept_s(self, now_ns: int) -> float | None:
        """How long the formation has been sweeping; None before all UAVs have had time to take it up."""
        plan = self.plan
        return (now_ns - _taken_up_ns(plan)) / S if plan is not None and self.is_taken_up(now_ns) else None


def along(moves: Enu, east_m: float, north_m: float) -> tuple[float, float]:
    """An offset as metres ahead and right of a place that moves with `moves`; north is ahead of one at rest."""
    east, north = _heading(moves)
    return east_m * east + north_m * north, east_m * north - north_m * east


def _heading(moves: Enu) -> tuple[float, float]:
    speed = moves.horizontal()
    return (moves.east / speed, moves.north / speed) if speed > 1e-9 else (0.0, 1.0)


def _beside(lane: Enu, moves: Enu, ahead_m: float, aside_m: float) -> Enu:
    """The position this far ahead and to the right of a place (`along`)."""
    east, north = _heading(moves)
    return Enu(lane.east + ahead_m * east + aside_m * north, lane.north + ahead_m * north - aside_m * east, lane.up)


def _on_way(
    start: Enu, goal: Enu, *, from_ns: int, to_ns: int, now_ns: int, over: tuple[Enu, int] | None = None
) -> tuple[Enu, Enu]:
    """The position and velocity of a UAV that flies straight from `start` to `goal`, to be there at `to_ns`. `over`:
    another place over which it flies at an instant, if it leaves before.
    """
    if over is not None and from_ns < over[1]:
        if now_ns < over[1]:
            goal, to_ns = over
        else:
            start, from_ns = over
    span_ns = to_ns - from_ns
    if now_ns <= from_ns or span_ns <= 0:
        return start, STILL
    share, per_s, way = (now_ns - from_ns) / span_ns, S / span_ns, goal.minus(start)
    return (
        Enu(start.east + share * way.east, start.north + share * way.north, start.up + share * way.up),
        Enu(way.east * per_s, way.north * per_s, way.up * per_s),
    )


def _taken_up_ns(plan: Search) -> int:
    """The instant at which all UAVs have had time to fly to their places, and the sweep begins."""
    return plan.start_us * US + plan.deploy_ds * 100 * MS
