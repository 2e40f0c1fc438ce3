"""The leader's part: know where everyone is from joins, divide the nodes into clusters, announce the schedule.

    joins -> no more for a moment -> division -> schedule, once per flooding period
    somebody is new or gone, or what stands has become too bad -> another epoch, at most one per `clusters.reassign_s`

Joins come in bursts, so an assignment waits until no join has come for a moment. A leader that was elected knows nobody
yet: it calls, and assigns when all had the time to answer. Positions are carried on by dead reckoning.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from fanet_mw.graph.topology import Adjacency, within_range
from fanet_mw.routing.clustered.clustering import Cluster, Swarm, succession
from fanet_mw.routing.clustered.clustering.division import Division, drift
from fanet_mw.routing.clustered.roles.lease import Authority
from fanet_mw.routing.clustered.roles.position_updates import LOST_NS, Motion
from fanet_mw.routing.clustered.roles.signs_of_life import Signs
from fanet_mw.routing.clustered.timetable.link_state import LinkState, adjacency, worth_a_change
from fanet_mw.routing.clustered.timetable.turn_plan import measured_period_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.inner import CAPACITY, Join, Member, Schedule
from fanet_mw.wire.links import Link

SETTLE_NS: Final = 700 * MS
"""Quiet time after the last join before the clusters are computed."""
OBJECTION_NS: Final = 2 * S
"""A head that somebody stands in for has so long to show that it lives; meanwhile its cluster is served."""
_MISSED_NS: Final = 4 * S
"""A node was silent for about this long when it is said."""
_SURE: Final = 0.9
"""Of the range of a link: places are good to a tenth of it."""
_OBJECTION_PERIODS: Final = 4
"""And this long with a timetable: the word that it is silent waits for a contention window, its answer for a turn."""
ANSWER_NS: Final = 3500 * MS
"""Joins that answer a call have come after this: they are spread over 3 s."""
_FIRST_CALL_NS: Final = 5 * S
"""The first leader calls only if nobody has joined by then."""
HEARD_NS: Final = 1500 * MS
"""An announcement has reached everyone after this."""
_ANNOUNCEMENTS: Final = 4
"""Over links that lose frames, an assignment has reached everyone after so many announcements."""
_MOST: Final = 0.9
"""Of the nodes: when so many have told their links, those are used though some are missing."""
_DRIFT: Final = 0.03
"""A timetable is made anew when more than this share of the links has changed."""


class _StandIn(NamedTuple):
    """Who serves a cluster in place of its silent head, or only missed the node."""

    node: NodeId
    since_ns: int
    """When we heard of it."""
    said_ns: int
    """When it was said: whoever generated something later lives."""


class _Assigned(NamedTuple):
    """What stands."""

    clusters: Sequence[Cluster] = ()
    places: Mapping[NodeId, Enu] = MappingProxyType({})
    links: Adjacency = MappingProxyType({})
    start_ns: int = 0
    parts: Sequence[Schedule] = ()
    measured: tuple[Link, ...] = ()
    """The links that everyone computes the timetable from; none: places decide."""

    @property
    def nodes(self) -> list[NodeId]:
        return [node for cluster in self.clusters for node in cluster.members]


class Leader:
    """Computes schedules out of joins."""

    def __init__(
        self,
        authority: Authority,
        *,
        scenario: Scenario,
        signs: Signs,
        needs_every_link: bool,
        epoch: int,
        elected: bool,
        now_ns: int,
    ) -> None:
        """`needs_every_link`: a timetable is made out of the assignment, for which more is watched and made anew."""
        clusters = scenario.clusters
        self._authority = authority
        self._signs = signs
        self._period_ns = clusters.period_ns
        self._reassign_ns = seconds_to_ns(clusters.reassign_s)
        self._range_m = clusters.link_m or scenario.radio.range_m
        self._by_links = needs_every_link
        self._objection_ns = max(OBJECTION_NS, _OBJECTION_PERIODS * clusters.period_ns if self._by_links else 0)
        self._division = Division(
            clusters.method, count=clusters.count, range_m=self._range_m, options=clusters.options
        )
        self._epoch = epoch
        self._motions: dict[NodeId, Motion] = {}
        self._stand_ins: dict[NodeId, _StandIn] = {}
        self._links = LinkState() if scenario.measures_links else None
        self._measured_ns = measured_period_ns(scenario)
        """How often an assignment is announced whose links have been measured: once per superframe."""
        self._outbid = False
        """Somebody has announced an epoch in our name: ours must be a later one, whatever has changed."""
        self._assigned = _Assigned()
        self._due_ns = now_ns if elected else now_ns + _FIRST_CALL_NS
        self._announced_ns = now_ns
        self._not_before_ns = now_ns + ANSWER_NS if elected else now_ns

    def joined(self, join: Join, *, born_ns: int, now_ns: int) -> None:
        """A node said where it is, or that it stands in. The leader itself is a member of no cluster (paper, 4.1)."""
        node, silent = NodeId(join.node), NodeId(join.instead_of)
        if node == self._authority.leader:
            return
        known = self._motions.get(node)
        if known is not None and known.at_ns >= born_ns:
            return
        self._motions[node] = Motion(join.position, join.velocity, born_ns)
        if known is None:
            self._due_ns = max(now_ns + SETTLE_NS, self._not_before_ns)
        if silent != node:
            self.suspect(silent, node, self._motions[node], now_ns=now_ns)

    def measured(self, node: NodeId, links: Sequence[Link]) -> None:
        """A node, perhaps the leader itself, said how well it hears whom."""
        if self._links is not None:
            self._links.told(node, links)

    def outbid(self, epoch: int, *, now_ns: int) -> None:
        """A schedule in our name that is not ours: the next epoch comes after it, and soon."""
        if 0 < ((epoch - self._epoch) & 0xFFFF) < 0x8000 and self._assigned.parts:
            self._epoch, self._outbid = epoch, True
            self._due_ns = min(self._due_ns, now_ns + SETTLE_NS)

    def suspect(self, silent: NodeId, by: NodeId, there: Motion, *, now_ns: int) -> None:
        """A node is said to be silent, by one who says where it is itself: it has a moment to object."""
        if silent in self._motions and (not self._by_links or self._near(silent, there)):
            known = self._stand_ins.get(silent, _StandIn(by, now_ns, there.at_ns))
            self._stand_ins[silent] = known._replace(node=by)
            self._due_ns = min(self._due_ns, max(known.since_ns + self._objection_ns, now_ns))

    def _near(self, node: NodeId, there: Motion) -> bool:
        """Whether the two should have heard each other all the while: who flew away is not silent, but elsewhere."""
        known = self._motions[node]
        instants = (there.at_ns - _MISSED_NS, there.at_ns)
        apart = (known.position_at(t_ns).minus(there.position_at(t_ns)).norm() for t_ns in instants)
        return max(apart) <= _SURE * self._range_m

    def next_wake_ns(self) -> int:
        return self._due_ns

    def wake(self, here: Motion, *, notice_ns: int = 0, now_ns: int) -> Sequence[Schedule]:
        """The schedule parts to announce now; `here`: the leader itself.

        New ones come into force `notice_ns` after this at the soonest, and not before all should have heard of them.
        """
        if now_ns < self._due_ns:
            return []
        self._forget(now_ns)
        if self._motions and now_ns >= self._not_before_ns:
            self._renew(here, notice_ns, now_ns)
        self._due_ns = now_ns + (self._measured_ns if self._assigned.measured else self._period_ns)
        if now_ns < self._not_before_ns:
            self._due_ns = min(self._due_ns, self._not_before_ns)
        self._announced_ns = now_ns
        return self._assigned.parts or [self._call(now_ns)]

    def _call(self, now_ns: int) -> Schedule:
        """Nobody is assigned yet: who hears this joins."""
        period_us = self._period_ns // US
        term, leader = self._authority
        return Schedule(now_ns // US, period_us, period_us, 0, leader, 1, 0, 1, (), term)

    def _forget(self, now_ns: int) -> None:
        """Nodes of which there was no sign for long, and heads that somebody stands in for, unless they live."""
        for node in sorted(self._motions):
            last_ns = max(self._signs.last_ns(node) or 0, self._motions[node].at_ns)
            stand_in = self._stand_ins.get(node)
            if stand_in is not None and last_ns > stand_in.said_ns:
                del self._stand_ins[node]  # it objected
                stand_in = None
            if now_ns - last_ns > LOST_NS or (
                stand_in is not None and now_ns >= stand_in.since_ns + self._objection_ns
            ):
                del self._motions[node]

    def _renew(self, here: Motion, notice_ns: int, now_ns: int) -> None:
        """Another epoch, if there is a reason."""
        before = self._assigned
        changed = self._outbid or sorted(self._motions) != sorted(before.nodes)
        rests = not self._reassign_ns or self._stand_ins or now_ns < before.start_ns + self._reassign_ns
        measured = self._measured()
        if not changed and rests and not (measured and not before.measured):
            return
        measured_ns = _ANNOUNCEMENTS * self._measured_ns if before.measured else 0
        notice_ns = max(HEARD_NS, notice_ns, measured_ns)
        decided_ns = max(now_ns, self._announced_ns + self._period_ns)  # who heard the last one expects no news before
        start_ns = (decided_ns + notice_ns) // self._period_ns * self._period_ns + self._period_ns
        places = self._places(here, start_ns)
        members = {node: place for node, place in places.items() if node != self._authority.leader}
        links = within_range(places, range_m=self._range_m) if not measured else adjacency(measured, places)
        near = within_range(members, range_m=self._range_m) if not measured else adjacency(measured, members)
        swarm = Swarm(members, near, velocities=self._velocities())
        stand_ins = {head: self._stand_ins[head].node for head in sorted(self._stand_ins)}
        clusters = self._division.renew(before.clusters, swarm, stand_ins, now_ns=now_ns)
        same = [(c.head, sorted(c.members)) for c in clusters] == [(c.head, sorted(c.members)) for c in before.clusters]
        if measured:
            moved = worth_a_change(before.measured, measured)
        else:
            moved = self._by_links and drift(before.links, links) > _DRIFT
        if not changed and same and not moved:
            return
        self._stand_ins = {head: who for head, who in self._stand_ins.items() if head in self._motions}
        ordered = [Cluster(cluster.head, succession(cluster, swarm)) for cluster in clusters]
        self._epoch, self._outbid = (self._epoch + 1) & 0xFFFF or 1, False
        self._assigned = _Assigned(ordered, places, links, start_ns, self._parts(ordered, start_ns), measured)

    def _measured(self) -> tuple[Link, ...]:
        """The links to plan with; none until most nodes have told theirs: of the rest their neighbors know."""
        if self._links is None:
            return ()
        nodes = [*self._motions, NodeId(self._authority.leader)]
        known = self._assigned.measured or self._links.known(nodes) >= _MOST * len(nodes)
        return self._links.between(nodes) if known else ()

    def _places(self, here: Motion, start_ns: int) -> dict[NodeId, Enu]:
        """Where everyone will be in the middle of the time for which the assignment is made."""
        t_ns = start_ns + self._reassign_ns // 2
        motions = self._motions | {NodeId(self._authority.leader): here}
        return {node: motions[node].position_at(t_ns) for node in sorted(motions)}

    def _velocities(self) -> Mapping[NodeId, Enu]:
        return {node: self._motions[node].velocity for node in sorted(self._motions)}

    def _parts(self, clusters: list[Cluster], start_ns: int) -> list[Schedule]:
        """The schedule; its superframes begin when all should have heard of it."""
        members = [
            Member(node, index, node == cluster.head)
            for index, cluster in enumerate(clusters)
            for node in cluster.members
        ]
        chunks = [members[at : at + CAPACITY] for at in range(0, len(members), CAPACITY)]
        return [
            Schedule(
                start_us=start_ns // US,
                period_us=self._period_ns // US,
                slot_us=self._period_ns // len(clusters) // US,
                epoch=self._epoch,
                leader=self._authority.leader,
                clusters=len(clusters),
                part=part,
                parts=len(chunks),
                members=tuple(chunk),
                term=self._authority.term,
            )
            for part, chunk in enumerate(chunks)
        ]

    @property
    def links(self) -> tuple[Link, ...]:
        """The measured links of the assignment that is announced."""
        return self._assigned.measured

    @property
    def epoch(self) -> int:
        """The number of the assignment that is announced."""
        return self._epoch

    def place(self, node: int) -> Enu:
        """Where a member, or the leader itself, was taken to be for the assignment that is announced."""
        return self._assigned.places[NodeId(node)]
