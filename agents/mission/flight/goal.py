"""The goal of a searching UAV: an order's place; a survivor, within the limits of its formation; or its lane."""

from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.flight.errand import Errand
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.search_place import SearchPlace, along
from agents.mission.tasking.absence import Absence
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.bidding import FAR_M
from agents.mission.tasking.voice_descent import VoiceDescent
from fanet_mw.units import STILL, Enu

_SHARED_M: Final = 35.0
"""An estimate this near to the border of two lanes belongs to both."""


class Goal:
    """The place to which one UAV flies, by what it has found and by its place in the formation."""

    def __init__(
        self,
        survivors: KnownSurvivors,
        own_motion: OwnMotion,
        formation: SearchPlace,
        approach: Approach,
        listening: VoiceDescent | None,
        errand: Errand | None = None,
        *,
        absence: Absence,
    ) -> None:
        """`listening`: takes a UAV with microphones down; None for a UAV without. `errand`: what the post orders."""
        self._errand, self._absence = errand, absence
        self._survivors, self._own_motion = survivors, own_motion
        self._formation, self._approach = formation, approach
        self._listening = listening

    def at(self, task: int | None, now_ns: int) -> tuple[Enu, Enu]:
        ordered = None if self._errand is None else self._errand.goal(now_ns)
        if ordered is not None:
            return ordered, STILL
        formation = self._formation
        lane, moves = formation.lane(now_ns)  # before the sweep, on the way to it
        survivor = task
        leaves = formation.is_free(now_ns) or not formation.is_taken_up(now_ns)
        if not leaves:
            place = None if task is None else self._survivors.by_id[task].place()
            if task is None or not formation.leads_by(place, lane, moves):
                leaves = task is not None and (self._absence.is_permitted or formation.finishes(place, now_ns))
                survivor = task if leaves else self._in_lane(lane, moves, now_ns)
        place = None if survivor is None else self._survivors.by_id[survivor].place()
        if survivor is None or place is None:
            return lane, moves
        east, north = self._approach.next_point(survivor, place, now_ns, responding=survivor == task)
        look, seen = Enu(east, north, lane.up), self._survivors.by_id[survivor].filter.is_seen
        if self._listening is not None:
            misses_m = 0.0 if leaves else formation.misses_m(place, lane, moves, now_ns)
            look = self._listening.goal(survivor, place, look, seen=seen, misses_m=misses_m, now_ns=now_ns)
        if leaves:
            return look, STILL
        goal, feed = formation.bounded(
            look.east, look.north, lane, moves, now_ns, leads=survivor == task, views=not seen
        )
        return goal._replace(up=look.up), feed

    def _in_lane(self, lane: Enu, moves: Enu, now_ns: int) -> int | None:
        """The nearest survivor beside the UAV's lane, whom it examines in passing, without leaving the formation."""
        formation, here = self._formation, self._own_motion.position
        pattern = formation.pattern
        if pattern is None or not formation.searches or not formation.is_taken_up(now_ns):
            return None
        best: tuple[float, int] | None = None
        for survivor in self._survivors.sought():
            known = self._survivors.by_id[survivor]
            estimate = known.place() if known.filter.near(here, within_m=FAR_M) else None
            if estimate is None or estimate.is_vague:
                continue
            _, aside_m = along(moves, estimate.east_m - lane.east, estimate.north_m - lane.north)
            if abs(aside_m) > 0.5 * pattern.shape.lane_m + _SHARED_M:
                continue
            if formation.leads_by(estimate, lane, moves):
                candidate = estimate.distance_m(here), survivor
                best = candidate if best is None else min(best, candidate)
        return None if best is None else best[1]
