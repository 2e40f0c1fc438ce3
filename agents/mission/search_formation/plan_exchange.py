"""How all UAVs come to one plan: each sends its status, one of them plans (`formation_planner.py`), all follow it."""

from collections.abc import Callable
from typing import Final

from agents.mission.navigation.neighbor_motions import falls
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox, OutgoingPacket
from agents.mission.search_formation.formation_planner import STATUS_S, FormationPlanner, size_factor
from agents.mission.search_formation.pattern import Pattern
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.search_place import SearchPlace
from fanet_mw.motion import Motion
from fanet_mw.trace import Planned
from fanet_mw.units import MS, US, NodeId, S
from fanet_mw.wire.search_messages import Roll
from fanet_mw.wire.search_plan import Search, SearchStatus

_FIRST_STATUS_S: Final = 2
"""A UAV of a small swarm sends its first status at a random instant within this time after its start."""
_ALARM_NS: Final = 2 * S
"""The least time between two floods by which a UAV tells all who is lost."""
_SPREAD_NS: Final = 400 * MS
"""All in reach find a loss at about the same instant. Each tells it at a random one within this time, unless another
has told the same by then: 45 floods at once are more than bounds allow for."""


class PlanExchange:
    """The part of one UAV in the exchange of statuses and plans."""

    def __init__(
        self,
        node: NodeId,
        planner: FormationPlanner,
        roll_call: RollCall,
        place: SearchPlace,
        own_motion: OwnMotion,
        outbox: Outbox,
        *,
        pattern: Pattern | None,
        random: Callable[[], float],
        uavs: int,
    ) -> None:
        """`pattern`: the formation to plan, if this UAV has to; None if the UAVs are too few for one. `uavs`: their
        number, by which each sends its status more or less often.
        """
        self._node = node
        self._planner, self._place, self._roll_call = planner, place, roll_call
        self._own_motion, self._outbox = own_motion, outbox
        self._pattern = pattern
        self._random = random
        self._status_ns, self._first_ns = STATUS_S * size_factor(uavs) * S, _FIRST_STATUS_S * size_factor(uavs) * S
        self._next_status_ns = 0
        self._adopted_ns = 0
        """The instant at which this UAV began to follow its plan."""
        self._next_alarm_ns = 0
        self.alarm_ns: int | None = None
        """The instant at which this UAV will tell all who is lost; None if there is no news."""
        self._flies_home = False
        """True if this UAV takes no place any more, whatever the plan says."""
        self._absent = False
        """True while this UAV is out of its place for a survivor."""

    def start(self, now_ns: int) -> None:
        self._next_status_ns = now_ns + round(self._random() * self._first_ns)

    def review(self, percent: int, now_ns: int) -> None:
        """Send a status if one is due, plan if this UAV is the planner, and put new plans into the outbox."""
        if now_ns >= self._next_status_ns:
            self.say_status(percent, now_ns)
        if self._planner.review(self._pattern, now_ns=now_ns):
            self._adopt(now_ns)
        plans, self._planner.to_tell = self._planner.to_tell, []
        self._outbox.packets += [OutgoingPacket(plan.encode_frame(self._node)) for plan in plans]

    def close_ranks(self, now_ns: int) -> None:
        """Find who is lost, and fly on without them."""
        if self._place.plan is not None:
            own_falls = falls(self._own_motion.velocity)
            self._roll_call.review(self._place.plan, since_ns=self._adopted_ns, falls=own_falls, now_ns=now_ns)
            if self._roll_call.has_news and self.alarm_ns is None:
                waits = 0.0 if own_falls else self._random()  # who falls has no time
                self.alarm_ns = max(now_ns, self._next_alarm_ns) + round(waits * _SPREAD_NS)
            self.tell_losses(now_ns)
            away = {*self._planner.leavers, *self._planner.absent}
            parted = set(self._roll_call.parted) - self._roll_call.lost.keys()
            self._place.close_ranks(self._roll_call.lost, now_ns, away=away, parted=parted)

    def tell_losses(self, now_ns: int) -> None:
        """If it is time to tell all who is lost, or back, flood it unless another UAV has done so."""
        if self.alarm_ns is None or now_ns < self.alarm_ns:
            return
        self.alarm_ns = None
        if self._roll_call.has_news:
            self._roll_call.has_news, self._next_alarm_ns = False, now_ns + _ALARM_NS
            self._outbox.packets.append(OutgoingPacket(self.hello_frames(now_ns)))

    def say_status(self, percent: int, now_ns: int) -> None:
        """Send this UAV's status: its position, its plan, and the percentage of its battery that it may still spend."""
        plan = self._planner.plan
        status = SearchStatus(
            now_ns // US, self._own_motion.position, self._node, plan.revision if plan else 0, percent, self._absent
        )
        self._planner.status(status, now_ns=now_ns)
        self._outbox.packets.append(OutgoingPacket(status.encode_frame(self._node)))
        self._next_status_ns = now_ns + round((0.8 + 0.4 * self._random()) * self._status_ns)

    def be_absent(self, percent: int, now_ns: int, *, goes: bool) -> None:
        """Tell all when this UAV goes out of its place for a survivor (`goes`), and when it is back."""
        absent = goes or (self._absent and not self._place.is_near(now_ns))
        if absent != self._absent:
            self._absent = absent
            self.say_status(percent, now_ns)

    def leave(self) -> None:
        """Give up the place in the formation, and take none until this UAV comes back."""
        self._flies_home = True
        self._place.leave()

    def come_back(self, percent: int, now_ns: int) -> None:
        """Take part again: follow the plan, and tell all; whoever has lost the place gets a vacant one."""
        self._flies_home = False
        if self._planner.plan is not None:
            self._adopt(now_ns)
        self.say_status(percent, now_ns)

    # --- received messages ----------------------------------------------------------------------------------------

    def on_hello(self, node: int, motion: Motion, *, now_ns: int) -> bool:
        """A neighbor's hello states how it flies; returns True if it was lost."""
        self._planner.on_neighbor(node, motion.position, now_ns=now_ns)
        self._place.see(node, motion.position, now_ns)
        returned, it_falls = node in self._roll_call.lost, falls(motion.velocity)
        self._roll_call.on_hello(node, now_ns=now_ns, falls=it_falls)
        return returned and not it_falls

    def on_roll(self, roll: Roll, *, flooded: bool, now_ns: int) -> None:
        """Another UAV tells its neighbors, or all, who was heard when."""
        self._roll_call.on_roll(roll, self._place.plan, flooded=flooded, now_ns=now_ns)

    def hello_frames(self, now_ns: int) -> bytes:
        """The inner frame for the next hello that tells who was heard when; empty without a plan."""
        plan = self._place.plan
        return b"" if plan is None else self._roll_call.roll(plan, now_ns=now_ns).encode_frame(self._node)

    def on_status(self, status: SearchStatus, *, now_ns: int) -> None:
        self._planner.status(status, now_ns=now_ns)
        self._place.see(status.node, status.position, min(now_ns, status.t_us * US))

    def on_plan(self, plan: Search, *, now_ns: int) -> None:
        """A plan was received; this UAV follows it if it is newer than the plan in force."""
        if self._planner.on_plan(plan):
            self._adopt(now_ns)

    def _adopt(self, now_ns: int) -> None:
        plan = self._planner.plan
        assert plan is not None, "there is a plan to adopt"
        self._adopted_ns = now_ns
        self._place.adopt(plan, now_ns)
        if self._flies_home:
            self._place.leave()
        place = self._place.place
        self._outbox.records.append(Planned(now_ns, self._node, plan.revision, -1 if place is None else place))
