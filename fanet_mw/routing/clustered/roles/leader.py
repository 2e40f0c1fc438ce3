"""The leader's work: it learns from joins where nodes are, divides them into clusters, and announces the schedule.

    joins -> none for a moment -> clusters -> schedule, announced once per flooding period

An *epoch* is one assignment of nodes to clusters. The leader begins a new one when

    a node is new, or has gone                 at the next announcement; one that is reported silent may object first
    a schedule is forged in the leader's name  at the next announcement
    the links of most nodes are measured       at the next announcement, for the first time
    the clusters or links have become too bad  `clusters.reassign_s` after the present epoch began, and once it is known
                                               who has turned with the leader; never if `reassign_s` is 0
    the load of nodes has changed              likewise, with `clusters.load = "heard"`; after `_RELOAD_NS` if that is 0
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from fanet_mw.graph.topology import Adjacency, within_range
from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.clustering import Cluster, Swarm, succession
from fanet_mw.routing.clustered.clustering.division import Division, drift
from fanet_mw.routing.clustered.links.heard_load import HeardLoads
from fanet_mw.routing.clustered.links.link_quality import LinkState, adjacency, worth_a_change
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader_election import Authority, silence_ns
from fanet_mw.routing.clustered.roles.membership import EPOCH_BITS
from fanet_mw.routing.clustered.roles.position_updates import lost_ns, settled_ns
from fanet_mw.routing.clustered.roles.roster import NO_SILENCE, Roster, sure_m
from fanet_mw.scenario import Scenario
from fanet_mw.serial_number import following, newer
from fanet_mw.units import MS, US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.links import Link
from fanet_mw.wire.loads import AS_EXPECTED
from fanet_mw.wire.schedule import CAPACITY, Join, Member, Schedule

SETTLE_NS: Final = 700 * MS
"""The time without a join after which the clusters are computed."""
_LONGEST_SETTLING_NS: Final = 10 * S
"""The longest time that the leader waits for joins to end before it divides the nodes for the first time."""
OBJECTION_NS: Final = 2 * S
"""The time that a node has to object when it is reported silent; meanwhile a stand-in serves its cluster."""
_OBJECTION_PERIODS: Final = 4
"""The same in superframes of a timetable: the report waits for a contention window, the objection for a turn."""
ANSWER_NS: Final = 3500 * MS
"""The time after a call at which the joins that answer it have arrived; nodes spread them over 3 s."""
_FIRST_CALL_NS: Final = 5 * S
"""The first leader calls only if no node has joined by then."""
HEARD_NS: Final = 1500 * MS
"""The time after which an announcement has reached all nodes."""
_ANNOUNCEMENTS: Final = 4
"""The number of announcements after which a schedule has reached all nodes over links that lose frames."""
_MOST: Final = 0.9
"""The share of nodes that must have reported their links before measured links are used."""
_RELOAD_NS: Final = 10 * S
"""The least time between two timetables for different loads, if the scenario gives none for reassignments."""
_DRIFT: Final = 0.03
"""The share of links that must have changed before a new timetable is made."""


class _Assigned(NamedTuple):
    """The assignment that the leader announces at present."""

    clusters: Sequence[Cluster] = ()
    places: Mapping[NodeId, Enu] = MappingProxyType({})
    links: Adjacency = MappingProxyType({})
    start_ns: int = 0
    parts: Sequence[Schedule] = ()
    measured: tuple[Link, ...] = ()
    """The links from which all nodes compute the timetable; empty if it is computed from positions."""
    loads: Mapping[NodeId, int] = MappingProxyType({})
    """The loads for which all nodes compute the timetable; empty if it is made for what the scenario says."""

    @property
    def nodes(self) -> list[NodeId]:
        return [node for cluster in self.clusters for node in cluster.members]


class Leader:
    """The leader's work at one node: joins in, schedules out."""

    def __init__(
        self,
        authority: Authority,
        *,
        scenario: Scenario,
        measured_period_ns: int,
        liveness: Liveness,
        needs_every_link: bool,
        heard: HeardLoads | None = None,
        epoch: int,
        elected: bool,
        now_ns: int,
    ) -> None:
        """`measured_period_ns`: the interval of announcements with measured links; `needs_every_link`: a change of
        links needs a new timetable; `heard`: measured loads, None: those that the scenario states.
        """
        clusters = scenario.clusters
        self._authority = authority
        self._period_ns = clusters.period_ns
        self._reassign_ns = seconds_to_ns(clusters.reassign_s)
        self._range_m = clusters.link_m or scenario.radio.range_m
        self._reaches = scenario.reaches
        self._by_links = needs_every_link
        self._roster = Roster(
            liveness,
            lost_ns=lost_ns(scenario),
            objection_ns=max(OBJECTION_NS, _OBJECTION_PERIODS * clusters.period_ns if needs_every_link else 0),
            sure_m=sure_m(self._range_m) if needs_every_link else None,
            settled_ns=settled_ns(scenario),
            rigid=scenario.mobility.rigid,
        )
        self._division = Division.of(scenario)
        self.epoch = epoch
        self._links = LinkState() if scenario.measures_links else None
        self._heard = heard
        self._measured_ns = measured_period_ns
        self._outbid = False
        """True if another node has announced an epoch in this leader's name, which the next one must come after."""
        self._assigned = _Assigned()
        self._due_ns = now_ns if elected else now_ns + _FIRST_CALL_NS
        self._announced_ns = now_ns
        self._not_before_ns = now_ns + ANSWER_NS if elected else now_ns
        """No assignment is made before this instant, at which all nodes have had time to answer the call."""

    def fly(self, here: Motion) -> None:
        """The leader itself flies as `here` states; a join tells where a node was beside it."""
        self._roster.own.add(here)

    def on_join(self, join: Join, here: Motion, *, born_ns: int, now_ns: int) -> None:
        """A node has joined, or stands in for a head; the leader, at `here`, is in no cluster (paper, 4.1)."""
        self.fly(here)
        node, silent = NodeId(join.node), NodeId(join.instead_of)
        if node == self._authority.leader:
            return
        if not self._roster.is_news(node, born_ns):
            return
        if node not in self._roster:
            self._due_ns = min(max(now_ns + SETTLE_NS, self._not_before_ns), max(now_ns, self._settled_ns()))
        motion = Motion(join.position, join.velocity, born_ns)
        self._roster.on_join(node, motion)
        if silent != node:
            self.on_suspicion(silent, node, motion, now_ns=now_ns)

    def _settled_ns(self) -> int:
        """The instant at which joins are waited for no longer."""
        if self._assigned.parts:
            return self._announced_ns + silence_ns(self._period_ns) * 3 // 4
        return max(self._announced_ns, self._not_before_ns) + _LONGEST_SETTLING_NS

    def on_links(self, node: NodeId, links: Sequence[Link]) -> None:
        """A node, perhaps the leader itself, has reported how well it hears its neighbors."""
        if self._links is not None:
            self._links.on_report(node, links)

    def on_outbid(self, epoch: int, *, now_ns: int) -> None:
        """A schedule was received in this leader's name that it has not made: announce a later epoch soon."""
        if newer(epoch, self.epoch, bits=EPOCH_BITS) and self._assigned.parts:
            self.epoch, self._outbid = epoch, True
            self._due_ns = min(self._due_ns, now_ns + SETTLE_NS)

    def on_suspicion(self, silent: NodeId, by: NodeId, there: Motion, *, now_ns: int) -> None:
        """The node `by`, at `there`, reports that `silent` is silent, which has some time to object."""
        until_ns = self._roster.on_report(silent, by, there, now_ns=now_ns)
        if until_ns is not None:
            self._due_ns = min(self._due_ns, max(until_ns, now_ns))

    def next_wake_ns(self) -> int:
        return self._due_ns

    def wake(
        self, here: Motion, *, notice_ns: int = 0, lost_ns: Mapping[NodeId, int] = NO_SILENCE, now_ns: int
    ) -> Sequence[Schedule]:
        """The parts of the schedule to announce now. A new one comes into force in `notice_ns` at the earliest, once
        all nodes should have it; nodes in `lost_ns` are lost after such a silence. `here`: the leader's motion.
        """
        if now_ns < self._due_ns:
            return []
        self.fly(here)
        self._roster.forget(now_ns, lost_ns=lost_ns)
        if self._roster.nodes and now_ns >= self._not_before_ns:
            self._renew(here, notice_ns, now_ns)
        self._due_ns = now_ns + (self._measured_ns if self._assigned.measured else self._period_ns)
        if now_ns < self._not_before_ns:
            self._due_ns = min(self._due_ns, self._not_before_ns)
        self._announced_ns = now_ns
        return self._assigned.parts or [self._call(now_ns)]

    def _call(self, now_ns: int) -> Schedule:
        """A call to all nodes to join, made while no node is assigned."""
        period_us = self._period_ns // US
        term, leader = self._authority
        return Schedule(now_ns // US, period_us, period_us, 0, leader, 1, 0, 1, (), term)

    def _renew(self, here: Motion, notice_ns: int, now_ns: int) -> None:
        """Begin a new epoch if one of the reasons holds that are listed at the top of this file."""
        before = self._assigned
        changed = self._outbid or sorted(self._roster.nodes) != sorted(before.nodes)
        rests = not self._reassign_ns or self._roster.stand_ins or now_ns < before.start_ns + self._reassign_ns
        measured = self._measured()
        loads = self._loads(now_ns)
        loaded = self._is_loaded_otherwise(loads, now_ns)
        if not changed and rests and not loaded and not (measured and not before.measured):
            return
        measured_ns = _ANNOUNCEMENTS * self._measured_ns if before.measured else 0
        notice_ns = max(HEARD_NS, notice_ns, measured_ns)
        decided_ns = max(now_ns, self._announced_ns + self._period_ns)  # nodes expect no new schedule within a period
        start_ns = (decided_ns + notice_ns) // self._period_ns * self._period_ns + self._period_ns
        places = self._places(here, start_ns, now_ns)
        members = {node: place for node, place in places.items() if node != self._authority.leader}
        links, near = self._near(places, measured), self._near(members, measured)
        swarm = Swarm(members, near, velocities=self._roster.velocities())
        clusters = self._division.renew(before.clusters, swarm, self._roster.stand_ins)
        same = [(c.head, sorted(c.members)) for c in clusters] == [(c.head, sorted(c.members)) for c in before.clusters]
        if measured:
            moved = worth_a_change(before.measured, measured)
        else:
            moved = self._by_links and drift(before.links, links) > _DRIFT
        worse = (moved or not same) and not (self._by_links and self._roster.is_turning(now_ns))
        if not changed and not worse and not loaded:
            return
        self._roster.forget_reports()
        ordered = [Cluster(cluster.head, succession(cluster, swarm)) for cluster in clusters]
        self.epoch, self._outbid = following(self.epoch, bits=EPOCH_BITS) or 1, False
        self._assigned = _Assigned(ordered, places, links, start_ns, self._parts(ordered, start_ns), measured, loads)

    def _loads(self, now_ns: int) -> Mapping[NodeId, int]:
        return {} if self._heard is None else self._heard.loads(sorted(self._roster.nodes), now_ns=now_ns)

    def _is_loaded_otherwise(self, loads: Mapping[NodeId, int], now_ns: int) -> bool:
        """True if the present assignment is for other loads, and has been in force for some time."""
        before, heard = self._assigned, self._heard
        rest_ns = self._reassign_ns or _RELOAD_NS
        if heard is None or not before.parts or now_ns < before.start_ns + rest_ns:
            return False
        period_ns = self._measured_ns if before.measured else self._period_ns
        return heard.worth_a_change(before.loads, loads, period_ns=period_ns, now_ns=now_ns)

    def _measured(self) -> tuple[Link, ...]:
        """Measured links to plan with; none until most nodes have reported, the others' being known from neighbors."""
        if self._links is None:
            return ()
        nodes = [*self._roster.nodes, NodeId(self._authority.leader)]
        known = self._assigned.measured or self._links.known(nodes) >= _MOST * len(nodes)
        return self._links.between(nodes) if known else ()

    def _near(self, places: Mapping[NodeId, Enu], measured: tuple[Link, ...]) -> Adjacency:
        """The links between nodes at these places: the measured ones, if there are any."""
        if measured:
            return adjacency(measured, places)
        return within_range(places, range_m=self._range_m, reaches=self._reaches)

    def _places(self, here: Motion, start_ns: int, now_ns: int) -> dict[NodeId, Enu]:
        """The positions of all nodes in the middle of the time for which the assignment is made."""
        t_ns = start_ns + self._reassign_ns // 2
        places = self._roster.places(t_ns, now_ns=now_ns) | {NodeId(self._authority.leader): here.position_at(t_ns)}
        return {node: places[node] for node in sorted(places)}

    def _parts(self, clusters: list[Cluster], start_ns: int) -> list[Schedule]:
        """The parts of the schedule, whose superframes begin when all nodes should have received it."""
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
                epoch=self.epoch,
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
        return self._assigned.measured

    def place(self, node: int) -> Enu:
        return self._assigned.places[NodeId(node)]

    def load(self, node: int) -> int:
        return self._assigned.loads.get(NodeId(node), AS_EXPECTED)
