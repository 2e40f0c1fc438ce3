"""Failover of cluster heads and leaders: finds the events that change a node's state, and looks them up in the table.

    announcements, stand-ins, signs of life, instants -> events -> `states.TRANSITIONS`
                                                                -> actions for `assigned_roles.py`

The first member of the succession, the order in which a schedule lists the members of a cluster, stands in for a silent
head (`failure_detectors.py`), or a later one if none before it has. It floods a join that names the silent node.
Without a timetable it also uses the slot of the head; with one any silent neighbor is reported likewise.
"""

from typing import Final

from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.roles.failure_detectors import HeadFailureDetector, Liveness
from fanet_mw.routing.clustered.roles.leader_election import Authority, Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.states import Action, Event, State, step
from fanet_mw.units import MS, NodeId
from fanet_mw.wire.schedule import Join, Schedule

_AGAIN_HELLOS: Final = 2.0
"""The hello intervals after which a stand-in announces itself again, until confirmed by a schedule."""
_OBJECT_NS: Final = 500 * MS
"""The shortest time between two objections of a node, because each is a flood."""
_LEADING: Final = State.LEADING  # members of an enumeration are looked up slowly, and this is asked at every wake-up


class Failover:
    """The state of one node, and the events that change it."""

    def __init__(
        self,
        *,
        membership: Membership,
        gradient: Gradient,
        liveness: Liveness,
        lease: Lease,
        node: NodeId,
        hello_ns: int,
        takes_slot: bool,
    ) -> None:
        """With `takes_slot` a stand-in uses the slot of the silent head; without it, it only informs the leader."""
        self.state = State.SEEKING
        self.silent_head = NodeId(0)
        self._takes_slot = takes_slot
        self._node = node
        self._membership = membership
        self._detector = HeadFailureDetector(gradient, liveness, hello_ns=hello_ns)
        self._liveness = liveness
        self._lease = lease
        self._hello_ns = hello_ns
        self._since_ns = 0
        self._named = NodeId(0)
        """The head that the last schedule named for this node's cluster."""
        self._object_ns = 0
        self._watch_ns: int | None = None
        """The instant at which this node next judges the head, or announces itself again as its stand-in."""

    def start(self, now_ns: int, *, leads: bool) -> None:
        self._lease.start(now_ns)
        if leads:
            self._lease.take_office(now_ns)
            self.state = State.LEADING

    @property
    def placed(self) -> bool:
        """True if the leader that this node follows has assigned it to a cluster."""
        version = self._membership.version
        return self._membership.assigned and version is not None and version.authority == self._lease.authority

    # --- receiving ------------------------------------------------------------------------------------------------

    def on_schedule(self, schedule: Schedule, *, guard_ns: int, born_ns: int, now_ns: int) -> list[Action]:
        """Handle a leader's announcement, received for the first time or made by this node."""
        authority, leads = Authority(schedule.term, schedule.leader), self.state is State.LEADING
        own = self._lease.authority
        if schedule.leader == self._node:
            if not leads or authority != own:
                return []  # the announcement was made before a restart, or before this node stepped down
        elif leads and own is not None and authority > own:
            return []  # the other leader is junior, and steps down when it receives this node's announcement
        actions = []
        if not leads or authority != own:
            prevails = own != authority
            if leads:
                self._lease.authority = None  # the other leader is senior, so this node is no longer leader
            if not self._lease.accept(authority, born_ns=born_ns, now_ns=now_ns):
                self._lease.authority = own
                return []
            if prevails:
                if leads:
                    self._membership.forget()
                actions.append(self._take(Event.NEW_LEADER, now_ns))
        event = self._membership.learn(schedule, guard_ns=guard_ns) if schedule.members else None
        if event is not None:
            actions.append(self._take(event, now_ns))
        return actions

    def on_stand_in(self, join: Join, *, born_ns: int, now_ns: int) -> list[Action]:
        """Handle the statement of a node that it stands in for a head; with a timetable, that some node is silent."""
        member = self._membership
        if not self._takes_slot and (join.instead_of == self._node or join.instead_of != member.head):
            return self._object(join, now_ns)
        rank, current = member.rank(join.node), member.rank(member.head)
        if not rank or current is None or self.state is State.LEADING or join.node == join.instead_of:
            return []  # the statement is from another cluster or epoch, or it is the objection of a head
        if self.state is State.HEAD:
            return [self._take(Event.HEAD_REPLACED, now_ns)]
        sign_ns = self._liveness.last_ns(member.head) or 0
        if join.node == member.head or (current < rank and (member.head == self._node or sign_ns > born_ns)):
            return []
        if self._takes_slot:
            member.follow(NodeId(join.node))
        return [self._take(Event.HEAD_REPLACED, now_ns)]

    def _object(self, join: Join, now_ns: int) -> list[Action]:
        """Object if another node states that this node is silent; rarely, because each objection is a flood."""
        called = join.instead_of == self._node != join.node
        if not called or now_ns < self._object_ns or self.state in (State.SEEKING, State.LEADING):
            return []
        self._object_ns = now_ns + _OBJECT_NS
        return [self._take(Event.SAID_SILENT, now_ns)]

    def on_sign_of_life(self, node: int, *, born_ns: int, now_ns: int) -> list[Action]:
        """A packet was received that a node generated at `born_ns`."""
        self._liveness.on_sign_of_life(node, born_ns=born_ns)
        member = self._membership
        if born_ns <= self._since_ns or node != member.named_head:
            return []
        replaced = self.state is State.ACTING or (self.state is State.MEMBER and member.head != node)
        return [self._take(Event.HEAD_BACK, now_ns)] if replaced else []

    def on_unreachable(self, node: NodeId, *, now_ns: int) -> None:
        if node == self._membership.head and self.state is State.MEMBER:
            self._detector.on_unreachable(now_ns)
            self._watch_ns = now_ns

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        if self.state is _LEADING:
            return None
        stand_ns = self._lease.stand_ns
        return stand_ns if self._watch_ns is None or stand_ns < self._watch_ns else self._watch_ns

    def wake(self, now_ns: int) -> list[Action]:
        if self.state is _LEADING:
            return []
        if now_ns >= self._lease.stand_ns and self._lease.review(now_ns):
            self._lease.take_office(now_ns)
            return [self._take(Event.LEADER_SILENT, now_ns)]
        if self._watch_ns is None or now_ns < self._watch_ns:
            return []
        if self.state is State.ACTING:
            self._watch_ns = now_ns + int(_AGAIN_HELLOS * self._hello_ns)
            return [self._take(Event.HEAD_SILENT, now_ns)]
        return self._judge(now_ns)

    def _judge(self, now_ns: int) -> list[Action]:
        """Stand in for the head if it is silent and this node is next in the succession."""
        member = self._membership
        rank, current = member.rank(self._node), member.rank(member.head)
        if self.state is not State.MEMBER or not rank or current is None or rank <= current:
            self._watch_ns = None
            return []
        silent_ns = self._detector.silent_from_ns(member.head, since_ns=self._since_ns, before=rank - current - 1)
        if silent_ns is None:
            self._watch_ns = now_ns + self._hello_ns
            return []  # this node has not been near the head since it began to follow it
        if now_ns < silent_ns:
            self._watch_ns = silent_ns
            return []
        self._watch_ns = now_ns + int(_AGAIN_HELLOS * self._hello_ns)
        return [self._take(Event.HEAD_SILENT, now_ns)]

    # --- the table ------------------------------------------------------------------------------------------------

    def _take(self, event: Event, now_ns: int) -> Action:
        """Take a row of the table; the state changes nowhere else."""
        before = self.state
        self.state, action = step(before, event)
        member = self._membership
        if event in (Event.NAMED_MEMBER, Event.NAMED_HEAD, Event.HEAD_BACK):
            member.obey()
        elif action in (Action.LEAVE, Action.RESIGN, Action.STEP_DOWN):
            member.resign()
        elif action is Action.TAKE_OVER and before is not State.ACTING:
            self.silent_head, self._since_ns = member.head, now_ns
            if self._takes_slot:
                member.follow(self._node)
        if action is Action.FOLLOW:
            if event is not Event.NAMED_MEMBER or self._named != member.named_head:
                self._since_ns = now_ns  # if the head is the same, what is known of it still holds
            self._named = member.named_head
            self._watch_ns = now_ns + self._hello_ns
        return action
