"""Builds the clustered protocol of one node: the only place that asks which `clusters.relay` a scenario has.

clusters.relay          roles      access            relaying
all, counter            assigned   slots of heads    contending, by that rule
scheduled               assigned   timetable         by turn; contending until there is one
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, NamedTuple

from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbors, neighbor_lifetime_ns
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.clustered import Clustered, Parts
from fanet_mw.routing.clustered.contract import HearsCopies, ScheduledAccess
from fanet_mw.routing.clustered.forwarding.contending_relays import ContendingRelaying
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.forwarding.one_way import OneWay, is_receipt
from fanet_mw.routing.clustered.forwarding.uplink import Uplink
from fanet_mw.routing.clustered.links.heard_load import HeardLoads, stated_loads
from fanet_mw.routing.clustered.links.link_quality import LinkQuality
from fanet_mw.routing.clustered.roles.assigned_roles import AssignedRoles, RoleParts
from fanet_mw.routing.clustered.roles.contract import NoTimetable, Timetabling
from fanet_mw.routing.clustered.roles.failover import Failover
from fanet_mw.routing.clustered.roles.failure_detectors import Deafness, Liveness, NeighborFailureDetector
from fanet_mw.routing.clustered.roles.joining import Joining
from fanet_mw.routing.clustered.roles.leader import Leader
from fanet_mw.routing.clustered.roles.leader_election import Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates
from fanet_mw.routing.clustered.roles.schedule_check import ScheduleCheck, ScheduleRefresh
from fanet_mw.routing.clustered.slots import SlotAccess, SlotRelease
from fanet_mw.routing.clustered.timetable.admission import Admission
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.routing.clustered.timetable.node_timetable import TimetablesInForce
from fanet_mw.routing.clustered.timetable.resumed_floods import ResumedFloods
from fanet_mw.routing.clustered.timetable.scheduled_relaying import ScheduledRelaying
from fanet_mw.routing.clustered.timetable.stated_delays import StatedDelays
from fanet_mw.routing.clustered.timetable.timetabling import FromPlaces
from fanet_mw.routing.clustered.timetable.turn_access import TurnAccess
from fanet_mw.routing.clustered.timetable.turn_allocation import leader_load
from fanet_mw.routing.clustered.timetable.turn_release import CallRelease, RootRelease
from fanet_mw.routing.clustered.timetable.turn_size import measured_period_ns, reserved
from fanet_mw.routing.missing_packets import MissingPackets
from fanet_mw.routing.packet_repair import FLOOD_OVER_NS, Repair
from fanet_mw.units import MS, S, seconds_to_ns

_STORE_PACKETS: Final = 4096
"""The most packets that a node keeps for repair; they take 4 MB at 1024 B."""
_ASKED_NS: Final = 10 * S
"""How long a node with a timetable asks for a packet that it lacks, unless the scenario repairs packets."""
_JITTER: Final = 0.25
"""The greatest random wait of a relay, as a share of the window: longer, a flood would advance one hop a superframe."""
_JOINED_NS: Final = 7500 * MS
"""A node should be in a timetable at the latest three superframes and this duration after its start. A join takes 3 s
and may be lost once; then the leader waits for further joins, and announces the timetable before it takes effect."""


class _Ground(NamedTuple):
    """The parts that the protocol has whatever `clusters.relay` is."""

    port: Port
    random: Callable[[], float]
    contention: ContentionTiming
    neighbors: Neighbors
    gradient: Gradient
    uplink: Uplink
    repair: Repair | None
    floods: Floods
    missing: MissingPackets | None

    @property
    def hello_ns(self) -> int:
        return seconds_to_ns(self.port.scenario.routing.hello_interval_s)

    @property
    def lifetime_ns(self) -> int:
        """The time after a neighbor's last hello at which what the hello said is forgotten."""
        return neighbor_lifetime_ns(self.port.scenario.routing.hello_interval_s)

    def queue(self) -> TxQueue:
        return TxQueue(self.port.scenario.routing, self.port.drop)


def make_clustered(port: Port) -> Clustered:
    """The clustered protocol of one node, in the variant that the scenario of its port chooses."""
    return RELAYS[port.scenario.clusters.relay](_ground(port))


def _ground(port: Port) -> _Ground:
    scenario = port.scenario
    random = port.stream("clustered").random
    hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
    neighbors = Neighbors(lifetime_ns=neighbor_lifetime_ns(scenario.routing.hello_interval_s))
    gradient = Gradient(node=port.node, neighbors=neighbors, hello_ns=hello_ns)
    contention = ContentionTiming(lead_ns=scenario.radio.lead_ns, jitter=random, window=port.stream("window").random)
    repair, missing, random_repair = None, None, port.stream("repair").random
    if scenario.repair_ns:
        repair = Repair(window_ns=scenario.repair_ns, capacity=_STORE_PACKETS, random=random_repair)
    elif scenario.clusters.resume and scenario.clusters.relay == "scheduled":
        missing = MissingPackets(patience_ns=FLOOD_OVER_NS, window_ns=_ASKED_NS)
        repair = Repair(
            window_ns=_ASKED_NS, capacity=_STORE_PACKETS, random=random_repair,
            begin_ns=contention.announced_ns,
        )  # fmt: skip
    uplink, floods = Uplink(port, gradient), Floods(port, repair, contention)
    return _Ground(port, random, contention, neighbors, gradient, uplink, repair, floods, missing)


# --- slots of heads ---------------------------------------------------------------------------------------------------


def _by_counter(ground: _Ground) -> Clustered:
    relaying = ContendingRelaying(ground.port, ground.contention, delays=ground.random)
    return _in_slots(ground, relaying, relaying.open_until)


def _in_slots(ground: _Ground, relaying: ContendingRelaying, *hear_copies: HearsCopies) -> Clustered:
    parts = _role_parts(ground, takes_slot=True)
    access = _slots(ground, parts.membership)
    roles = _roles(ground, parts, access, NoTimetable())
    whole = Parts(
        neighbors=ground.neighbors, gradient=ground.gradient, uplink=ground.uplink, repair=ground.repair,
        floods=ground.floods, roles=roles, access=access, relaying=relaying, contending=relaying,
        one_way=OneWay(ground.port, ground.neighbors),
    )  # fmt: skip
    return _protocol(ground, whole, *hear_copies, parts.refresh)


def _way_beside_turns(ground: _Ground) -> OneWay:
    """The way of packets beside turns: where turns bound delays, only receipts in windows; else all, at any time."""
    scenario = ground.port.scenario
    if scenario.rigid and not scenario.measures_links:
        not_before = ground.contention.not_before
        return OneWay(ground.port, ground.neighbors, takes=is_receipt, not_before=not_before)
    return OneWay(ground.port, ground.neighbors)


def _slots(ground: _Ground, membership: Membership) -> SlotAccess:
    scenario = ground.port.scenario
    release = SlotRelease(ground.queue(), scenario.clusters, lead_ns=scenario.radio.lead_ns)
    return SlotAccess(ground.port, release, membership=membership, uplink=ground.uplink, floods=ground.floods)


# --- a timetable ------------------------------------------------------------------------------------------------------


def _by_timetable(ground: _Ground) -> Clustered:
    port, scenario = ground.port, ground.port.scenario
    timetables = TimetablesInForce()
    ground.contention.turns_at = timetables.turns_at
    # without bounds that count on turns, a node that has a turn soon is worth more than turns that nobody disturbs
    ground.contention.membership_waits = scenario.rigid or scenario.measures_links
    ground.contention.most_jitter_ns = round(scenario.clusters.contention_ms * MS * _JITTER)
    parts = _role_parts(ground, takes_slot=False)
    lead_ns = scenario.radio.lead_ns
    roots = RootRelease(port.node, ground.queue(), reserved=reserved(scenario), lead_ns=lead_ns)
    calls = CallRelease(TxQueue(scenario.routing), lead_ns=lead_ns)
    spare = CallRelease(ground.queue(), lead_ns=lead_ns)
    followers = Followers(port.node)
    delays = StatedDelays(
        port, timetables=timetables, roots=roots, lease=parts.lease, admission=_admission(port), followers=followers
    )
    resumed = None if ground.missing is None else ResumedFloods(port, timetables, ground.floods)
    access = TurnAccess(
        port, timetables=timetables, roots=roots, calls=calls, spare=spare, slots=_slots(ground, parts.membership),
        delays=delays, floods=ground.floods, contention=ground.contention, resumed=resumed,
    )  # fmt: skip
    timetabling = FromPlaces(
        port,
        lease=parts.lease,
        membership=parts.membership,
        refresh=parts.refresh,
        delays=delays,
        access=access,
        followers=followers,
    )
    contending = ContendingRelaying(port, ground.contention)
    relaying = ScheduledRelaying(
        port, timetables, contending, resumed=resumed, repair=ground.repair, missing=ground.missing, followers=followers
    )
    stated = stated_loads(scenario)
    heard = HeardLoads(interval_s=scenario.traffic.interval_s, stated=stated) if scenario.hears_load else None
    whole = Parts(
        neighbors=ground.neighbors, gradient=ground.gradient, uplink=ground.uplink, repair=ground.repair,
        floods=ground.floods, roles=_roles(ground, parts, access, timetabling, heard), access=access, relaying=relaying,
        contending=contending, one_way=_way_beside_turns(ground), loads=heard, delays=delays, missing=ground.missing,
        deafness=Deafness(port, hello_ns=ground.hello_ns),
    )  # fmt: skip
    return _protocol(ground, whole, parts.refresh, calls)


def _admission(port: Port) -> Admission | None:
    """The admission control of a node; None without a deadline, and for a leader whose packets have no turns."""
    scenario = port.scenario
    if scenario.traffic.deadline_s is None or (port.node == scenario.leader and not leader_load(scenario)):
        return None
    return Admission(
        port.node,
        deadline_ns=seconds_to_ns(scenario.traffic.deadline_s),
        interval_ns=seconds_to_ns(scenario.traffic.interval_s),
        expected_ns=_JOINED_NS + 3 * scenario.clusters.period_ns,
    )


# --- roles ------------------------------------------------------------------------------------------------------------


def _role_parts(ground: _Ground, *, takes_slot: bool) -> RoleParts:
    """The parts of a node's roles. `takes_slot`: nodes watch heads and replace them; else they watch all neighbors."""
    port, scenario = ground.port, ground.port.scenario
    liveness, membership = Liveness(), Membership(port.node)
    lease = Lease(port.node, period_ns=scenario.clusters.period_ns, liveness=liveness)
    links = LinkQuality(port.node, hello_ns=ground.hello_ns) if scenario.measures_links else None
    updates = PositionUpdates(range_m=scenario.clusters.link_m or scenario.radio.range_m)
    return RoleParts(
        membership=membership,
        lease=lease,
        failover=Failover(
            membership=membership, gradient=ground.gradient, liveness=liveness, lease=lease, node=port.node,
            hello_ns=ground.hello_ns, takes_slot=takes_slot,
        ),
        joining=Joining(port, updates, links, ground.random),
        refresh=ScheduleRefresh(port.stream("refresh").random),
        check=ScheduleCheck(port, membership),
        detector=None if takes_slot else NeighborFailureDetector(liveness, hello_ns=ground.hello_ns),
        links=links,
        liveness=liveness,
    )  # fmt: skip


def _roles(
    ground: _Ground,
    parts: RoleParts,
    access: ScheduledAccess,
    timetabling: Timetabling,
    heard: HeardLoads | None = None,
) -> AssignedRoles:
    make_leader = partial(
        Leader,
        scenario=ground.port.scenario,
        measured_period_ns=measured_period_ns(ground.port.scenario),
        liveness=parts.liveness,
        needs_every_link=timetabling.needs_every_link,
        heard=heard,
    )
    return AssignedRoles(
        ground.port, parts, gradient=ground.gradient, access=access, timetabling=timetabling, make_leader=make_leader
    )


def _protocol(ground: _Ground, whole: Parts, *hear_copies: HearsCopies) -> Clustered:
    repaired = () if ground.repair is None else (ground.repair,)
    return Clustered(ground.port, whole, [*hear_copies, *repaired])


RELAYS: Final[Mapping[str, Callable[[_Ground], Clustered]]] = {
    "all": lambda ground: _in_slots(ground, ContendingRelaying(ground.port, ground.contention)),
    "counter": _by_counter,
    "scheduled": _by_timetable,
}
