"""Decides for which survivors one UAV bids, and to which of those that it has won it flies.

A survivor gets one responder at first. After 4 s with too few reporters a second one is wanted, for another bearing, or
all that the scenario wants (`mission.responders`) where UAVs may leave the formation. Once enough UAVs have reported
the survivor, all are wanted; before the sweep a vague place gets twice as many. A responder that does not get there, or
does not find the survivor, withdraws its bid after a while.
"""

import math
from collections.abc import Iterable
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors
from agents.mission.finding.phone_localization import Estimate
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from agents.mission.search_formation.search_place import SearchPlace, along
from agents.mission.tasking.absence import Absence
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.auction import Auction
from agents.mission.tasking.voice_descent import descent_ns
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Located
from fanet_mw.units import STILL, Enu, NodeId, S
from fanet_mw.wire.search_messages import Bid

FAR_M: Final = 450.0
"""A UAV does not bid for a survivor if the middle of the phone filter's grid is farther away than this."""
_SCOUT_AFTER_NS: Final = 4 * S
"""How long a survivor may have too few reporters before another UAV is sent to report it."""
_RETURN_AFTER_NS: Final = 45 * S
"""How long a responder searches for a survivor in vain before it withdraws its bid, without the time of a descent."""
_OVERDUE_NS: Final = 15 * S
"""Before the sweep a responder that has not arrived so long after it should have withdraws its bid: its links hold it
back, and soon all leave.
"""
_MEASURES_NS: Final = 30 * S
"""How long a responder is assumed to go round until a vague estimate has become a place."""
_ELSEWHERE_M: Final = 50.0
"""A responder begins anew if the estimate has moved so far: what it did not find, it has sought elsewhere."""
_AGAIN_NS: Final = 20 * S
"""How long a UAV that has withdrawn its bid does not bid again."""
_LONG_AGO_NS: Final = -(10**18)
"""Stands for an instant that has never been."""
_HANDOVER_S: Final = 15.0
"""The time that a responder is assumed to need at its present survivor."""
_ASTRAY_M: Final = 100.0
"""Before the sweep a UAV may be so far from the straight way to its place; farther if it will be there in time."""
_LATE_S: Final = 20.0
"""A UAV is in time if it is at its place at most so long after the sweep has begun: it catches up then."""
_MUCH_LATE_S: Final = 40.0
"""Before the sweep the first responder that is nearly at an exact place goes on while it would be late by this time at
most: what the lines leave behind they come by minutes later.
"""
_GLANCE_S: Final = 8.0
"""How long a UAV is assumed to look at the place of a survivor on the way to its own."""
_LOOKS_S: Final = 15.0
"""How long a UAV that leaves the formation for a survivor is assumed to look there."""
_PASSED_M: Final = 30.0
"""A UAV leaves its team for a survivor only who is this far behind its place: the team will pass those ahead."""
_LEAVES_S: Final = 10.0
"""By how much later a UAV that would leave its team bids, so that one goes that is free."""
_ABSENT: Final = 1
"""The number of UAVs that may leave the formation for a survivor."""
_ABSENT_VAGUE: Final = 2
"""The same where received powers do not tell the place yet: two that look on different sides need half the time."""
_BEFORE_SWEEP: Final = 2
"""Before the sweep, when UAVs have nothing else to do, a vague place gets this multiple of `mission.responders`: powers
received in more places tell where it is.
"""


class Bidding:
    """The bids of one UAV, and the survivor to whom it flies."""

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        *,
        survivors: KnownSurvivors,
        own_motion: OwnMotion,
        formation: SearchPlace,
        approach: Approach,
        absence: Absence,
        outbox: Outbox,
        speed_m_s: float,
    ) -> None:
        self._node = node
        self._config = scenario.mission
        self._cruise_m_s = max(0.1, scenario.mobility.speed_m_s)
        self._survivors, self._own_motion, self._formation = survivors, own_motion, formation
        self._approach, self._absence = approach, absence
        self._outbox = outbox
        self._speed_m_s = speed_m_s
        self._patience_ns = _RETURN_AFTER_NS + descent_ns(scenario)
        self._auction = Auction(node)
        self._taken_back_ns: dict[int, int] = {}
        """The instant at which this UAV withdrew its bid for each survivor."""
        self._located: set[int] = set()
        """The survivors whom this UAV has recorded as located."""
        self._announced = False
        """Whether this UAV has recorded that it flies to its present survivor."""
        self.survivor: int | None = None
        """The survivor to whom this UAV flies, or at whose place it is."""
        self._due_for: Estimate | None = None
        """The place to which this UAV flies as it was when it set out, or learned of another one."""
        self._due_ns = _LONG_AGO_NS
        """The instant at which it should have arrived there."""

    def merge(self, bids: Iterable[Bid], *, now_ns: int) -> None:
        """Take in bids that another UAV passes on."""
        open_bids = (bid for bid in bids if not self._survivors.is_found(bid.survivor))
        self._auction.merge(open_bids, now_ns=now_ns)

    def bids_to_tell(self, *, now_ns: int) -> list[Bid]:
        return self._auction.bids_to_tell(self._survivors.sought(), now_ns=now_ns)

    def close(self, survivor: int, *, now_ns: int) -> None:
        """Forget the bids for a survivor that needs no UAV any more."""
        self._auction.close(survivor)
        if self.survivor == survivor:
            self.survivor = None
            self.choose(now_ns)

    def reopen(self, survivor: int) -> None:
        """Treat a survivor as not visited yet, because a confirmation was taken back."""
        self._approach.forget(survivor)

    def hand_on(self, now_ns: int) -> None:
        """Withdraw all bids of this UAV, so that the next best bidders fly instead."""
        for survivor in self._survivors.sought():
            self._auction.withdraw(survivor, now_ns=now_ns)
        self.survivor = None

    def bid(self, now_ns: int, *, delay_s: float = 0.0) -> None:
        """Bid for survivors whom this UAV would win and whom its place in the formation permits; `delay_s`: until it
        can leave, because it takes off.
        """
        for survivor in self._survivors.sought():
            known = self._survivors.by_id[survivor]
            if not known.filter.near(self._own_motion.position, within_m=FAR_M):
                continue
            self._note_place(survivor, known, now_ns)
            if self._auction.has_bid(survivor):
                continue
            if now_ns - self._taken_back_ns.get(survivor, _LONG_AGO_NS) < _AGAIN_NS:
                continue
            eta_s = self._eta_s(survivor, delay_s, now_ns)
            if eta_s is None:
                continue
            if self._auction.would_win(survivor, eta_s=eta_s, count=self._wanted(known, now_ns), now_ns=now_ns):
                self._auction.bid(survivor, eta_s=eta_s, now_ns=now_ns)

    def choose(self, now_ns: int) -> None:
        """Stay with the present survivor, or choose the nearest of those won; `survivor` is None if there is none."""
        if self.survivor is not None:
            self._reconsider(self.survivor, now_ns)
        if self.survivor is None:
            won = [
                (self._distance_m(survivor), survivor)
                for survivor in self._survivors.sought()
                if self._node in self._winners(survivor, now_ns)
            ]
            if won:
                _, self.survivor = min(won)
                self._announced = False
                if now_ns - self._approach.arrived_ns.get(self.survivor, now_ns) > self._patience_ns:
                    self._approach.forget(self.survivor)
                self._due_for = self._survivors.by_id[self.survivor].place()
                self._due_ns = self._due_at(self._due_for, now_ns)
        if self.survivor is not None:
            self._approach.share([node for node in self._winners(self.survivor, now_ns) if node != self._node])
            if not self._announced:
                self._announce(self.survivor, now_ns)

    def _due_at(self, place: Estimate | None, now_ns: int) -> int:
        """The instant by which this UAV should be at a survivor's place, however long it was out for the survivor."""
        if place is None:
            return now_ns
        flies_s = place.distance_m(self._own_motion.position) / self._cruise_m_s
        return now_ns + round(flies_s * S) + (_MEASURES_NS if place.is_vague else 0)

    def _is_news(self, place: Estimate) -> bool:
        """True for a place that is exact, and another one than this UAV went to until now."""
        before = self._due_for
        return not place.is_vague and (before is None or before.is_vague or place.distance_m(before.at) > _ELSEWHERE_M)

    def _reconsider(self, survivor: int, now_ns: int) -> None:
        """Give up the present survivor if the auction is lost and this UAV is not nearly there. Give it up and withdraw
        the bid if it takes too long, or is not permitted any more.
        """
        arrived_ns, patience_ns = self._approach.arrived_ns.get(survivor), self._patience_ns
        place = self._survivors.by_id[survivor].place()
        if place is not None and self._is_news(place):
            self._due_for, self._due_ns, arrived_ns = place, self._due_at(place, now_ns), None
            self._approach.forget(survivor)
        nearly_there = arrived_ns is None and self._formation.finishes(place, now_ns)
        lost = self._node not in self._winners(survivor, now_ns) and not nearly_there
        if arrived_ns is None and self._formation.plan is not None and not self._formation.is_taken_up(now_ns):
            patience_ns = _OVERDUE_NS
        there_ns = self._due_ns if arrived_ns is None else arrived_ns
        late = now_ns - there_ns > patience_ns or not self._may_stay(survivor, now_ns)
        if late:
            self._auction.withdraw(survivor, now_ns=now_ns)
            self._taken_back_ns[survivor] = now_ns
        if lost or late:
            self.survivor = None

    def _may_stay(self, survivor: int, now_ns: int) -> bool:
        """True while this UAV may go on with a survivor, by its place in the formation or because it may be absent."""
        place = self._survivors.by_id[survivor].place()
        if self._is_within_limits(place, now_ns) or self._formation.finishes(place, now_ns):
            return True
        if place is None or not self._absence.permits(place, now_ns):
            return False
        return self._node in self._auction.winners(survivor, count=_absent(place), now_ns=now_ns)

    def _is_within_limits(self, place: Estimate | None, now_ns: int) -> bool:
        """True while this UAV may go on to a survivor's place without leaving the formation."""
        formation, here = self._formation, self._own_motion.position
        if not formation.is_taken_up(now_ns):
            near = formation.lane(now_ns)[0].horizontal_to(here) <= _ASTRAY_M
            return near or self._is_in_time(here, now_ns) or self._finishes_late(place, now_ns)
        if formation.is_free(now_ns):
            return formation.holds_together(place, now_ns, within_s=-5.0)
        return formation.leads_by(place, *formation.lane(now_ns))

    def _finishes_late(self, place: Estimate | None, now_ns: int) -> bool:
        """True before the sweep for the first responder to a survivor if it is nearly at an exact place, and would not
        be much too late at its own.
        """
        if self._formation.plan is None or not self._formation.is_nearly_at(place) or not self.is_first(now_ns):
            return False
        return self._absence.late_s(self._own_motion.position, now_ns, after_s=0.0) <= _MUCH_LATE_S

    def _may_look(self, place: Estimate | None, lane: Enu, moves: Enu) -> bool:
        """True if a UAV of a team may set out for an estimated place without leaving the formation: to a vague one only
        while it is ahead, or while the team rests.
        """
        if place is None or not self._formation.leads_by(place, lane, moves):
            return False
        ahead_m, _ = along(moves, place.east_m - lane.east, place.north_m - lane.north)
        return not place.is_vague or ahead_m > 0 or moves == STILL

    def _is_in_time(self, at: Enu, now_ns: int, *, after_s: float = 0.0) -> bool:
        """True if this UAV has a plan, and would be at its place in time (`_LATE_S`) if it left the position `at` in
        `after_s`.
        """
        has_plan = self._formation.plan is not None
        return has_plan and self._absence.late_s(at, now_ns, after_s=after_s) <= _LATE_S

    @property
    def may_be_absent(self) -> bool:
        """True if UAVs may leave the formation."""
        return self._absence.is_permitted

    def is_absent(self, now_ns: int) -> bool:
        """True while this UAV has left the formation for a survivor."""
        if self.survivor is None or not self._absence.is_permitted:
            return False
        return not self._is_within_limits(self._survivors.by_id[self.survivor].place(), now_ns)

    def responders(self, now_ns: int, *, first: bool = False) -> set[int]:
        """The UAVs that have won a task, as far as this one knows; `first`: of each task the one that arrives first."""
        most = 1 if first else None
        return {node for survivor in self._survivors.sought() for node in self._winners(survivor, now_ns)[:most]}

    def is_first(self, now_ns: int) -> bool:
        """True if this UAV flies to a survivor, and no other one arrives there before it by what they have bid."""
        return self.survivor is not None and self._winners(self.survivor, now_ns)[:1] == [self._node]

    def _announce(self, survivor: int, now_ns: int) -> None:
        """Record that this UAV flies to a survivor, if it has an estimate of the place."""
        known = self._survivors.by_id[survivor]
        place = known.place()
        if place is None:
            return
        self._announced = True
        east_m, north_m = round(place.east_m, 2), round(place.north_m, 2)
        self._outbox.records.append(Approaching(now_ns, self._node, survivor, len(known.reporters), east_m, north_m))

    def _note_place(self, survivor: int, known: KnownSurvivor, now_ns: int) -> None:
        """Record that a survivor is located, once the estimate of the place is not vague."""
        place = None if survivor in self._located else known.place()
        if place is not None and not place.is_vague:
            self._located.add(survivor)
            self._taken_back_ns.pop(survivor, None)  # this UAV withdrew while the place was vague
            east_m, north_m = round(place.east_m, 2), round(place.north_m, 2)
            self._outbox.records.append(Located(now_ns, self._node, survivor, east_m, north_m))

    def _wanted(self, known: KnownSurvivor, now_ns: int) -> int:
        """The number of UAVs that a survivor needs now."""
        is_near = known.filter.near(self._own_motion.position, within_m=FAR_M)  # a place far away is not computed
        if is_near and not self._formation.is_taken_up(now_ns):
            place = known.place()
            if place is None or place.is_vague:
                return _BEFORE_SWEEP * self._config.responders
        if len(known.reporters) >= self._config.reports_to_approach:
            return self._config.responders
        if now_ns - known.first_ns < _SCOUT_AFTER_NS:
            return 1
        return self._config.responders if self._absence.is_permitted else min(self._config.responders, 2)

    def _winners(self, survivor: int, now_ns: int) -> list[int]:
        """The UAVs that are to fly to a survivor, as far as this one knows, the earliest arrival first."""
        wanted = self._wanted(self._survivors.by_id[survivor], now_ns)
        return self._auction.winners(survivor, count=wanted, now_ns=now_ns)

    def _distance_m(self, survivor: int) -> float:
        place = self._survivors.by_id[survivor].place()
        return math.inf if place is None else place.distance_m(self._own_motion.position)

    def _eta_s(self, survivor: int, delay_s: float, now_ns: int) -> float | None:
        """The time with which this UAV bids for a survivor; None if its place in the formation does not permit that."""
        formation, here = self._formation, self._own_motion.position
        place = self._survivors.by_id[survivor].place()
        if place is None:
            return None
        busy_s = 0.0 if self.survivor is None else _HANDOVER_S + self._distance_m(self.survivor) / self._speed_m_s
        eta_s = delay_s + busy_s + place.distance_m(here) / self._speed_m_s
        leaves = self._absence.permits(place, now_ns, after_s=eta_s + _LOOKS_S) and self._auction.would_win(
            survivor, eta_s=eta_s, count=_absent(place), now_ns=now_ns
        )
        if not formation.is_taken_up(now_ns):
            lane, _ = formation.lane(now_ns + round(eta_s * S))
            if place.distance_m(lane) <= _ASTRAY_M or self._is_in_time(place.at, now_ns, after_s=eta_s + _GLANCE_S):
                return eta_s
            return eta_s + self._absence.late_s(place.at, now_ns, after_s=eta_s + _LOOKS_S) if leaves else None
        if formation.is_free(now_ns):
            return eta_s if leaves or formation.holds_together(place, now_ns, within_s=eta_s) else None
        lane, moves = formation.lane(now_ns)
        ahead_m, _ = along(moves, place.east_m - lane.east, place.north_m - lane.north)
        if self._may_look(place, lane, moves):
            ahead_m, _ = along(moves, place.east_m - here.east, place.north_m - here.north)
            return max(eta_s, abs(ahead_m) / self._cruise_m_s) if moves.norm() else eta_s
        if not formation.is_near(now_ns) and formation.finishes(place, now_ns):  # it is on the way back to its lane
            return eta_s
        if leaves and formation.searches and ahead_m < -_PASSED_M and formation.can_be_spared(now_ns):
            return eta_s + _LEAVES_S
        return None


def _absent(place: Estimate) -> int:
    """The number of UAVs that may leave the formation for a survivor who is estimated there."""
    return _ABSENT_VAGUE if place.is_vague else _ABSENT
