"""From a leader's announcements to a timetable: every node computes the same one from the same schedule and places.

    schedule parts, each with places  ->  all of one version  ->  timetable, in force from the schedule's start on
    and the links, where they are measured  -'

The leader adds to each schedule part the places of its members, and floods the measured links after the last part.
"""

from collections.abc import Mapping
from typing import Final, Protocol

from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.node.reader import decoded
from fanet_mw.routing.clustered.roles.leader import Leader
from fanet_mw.routing.clustered.roles.lease import Authority, Lease
from fanet_mw.routing.clustered.roles.membership import Membership, Version
from fanet_mw.routing.clustered.roles.schedule_refresh import ScheduleRefresh
from fanet_mw.routing.clustered.timetable.promises import Promises
from fanet_mw.routing.clustered.timetable.turn_access import TurnAccess
from fanet_mw.routing.clustered.timetable.turn_plan import Fitted, TurnPlan, fit, fit_measured
from fanet_mw.units import US, Enu, NodeId
from fanet_mw.wire.inner import Schedule
from fanet_mw.wire.links import Link, Links, frames_of
from fanet_mw.wire.places import Places, rounded

_LINKS_PART: Final = 1 << 16
"""Parts of the links are kept for neighbors behind those of the schedule."""


class Timetabling(Protocol):
    """The additions to a leader's schedule, and the timetable that a node makes of both."""

    needs_every_link: bool
    """True if a node that falls silent, or a link that is lost, cuts others off: the leader is told, and plans anew."""

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        """The inner frames that a part of the schedule is announced with."""

    def links_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        """The inner frames of the packets of links that follow a part of the schedule."""

    def read(self, packet: Packet, schedule: Schedule) -> Places | None:
        """Read what came with a part of a schedule; raises MalformedFrameError."""

    def on_schedule(self, packet: Packet, schedule: Schedule, places: Places | None, *, now_ns: int) -> None:
        """Take in what came with a part of a schedule that the roles have taken in."""

    def on_links(self, packet: Packet, *, now_ns: int) -> None:
        """Take in a packet of links that followed a schedule; raises MalformedFrameError."""

    def notice_ns(self, now_ns: int) -> int:
        """The time ahead at which the leader must announce another schedule."""


class NoTimetable:
    """A schedule says nothing but which node heads which cluster, and when its slot is."""

    needs_every_link = False

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        return b""

    def links_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        return []

    def read(self, packet: Packet, schedule: Schedule) -> Places | None:
        return None

    def on_schedule(self, packet: Packet, schedule: Schedule, places: Places | None, *, now_ns: int) -> None:
        """Do nothing: the roles have taken in all there is."""

    def on_links(self, packet: Packet, *, now_ns: int) -> None:
        """Do nothing: links are of no use without a timetable."""

    def notice_ns(self, now_ns: int) -> int:
        return 0


class FromPlaces:
    """Timetables from places, or from measured links, as the scenario says."""

    needs_every_link = True

    def __init__(
        self,
        port: Port,
        *,
        lease: Lease,
        membership: Membership,
        refresh: ScheduleRefresh,
        promises: Promises,
        access: TurnAccess,
    ) -> None:
        self._port = port
        self._lease = lease
        self._membership = membership
        self._refresh = refresh
        self._promises = promises
        self._access = access
        self._schedules: dict[int, tuple[Schedule, Places]] = {}
        self._measured: dict[int, Links] = {}
        """The links of the schedule's version, by part."""
        self._version: Version | None = None
        self._planned: Version | None = None
        self._announced_ns: dict[Version, int] = {}
        """The instants of the leader's latest announcements of the newest schedule, and of the one that is followed."""

    # --- at the leader --------------------------------------------------------------------------------------------

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        if not part.members:
            return b""
        places = tuple(rounded(leader.place(member.node)) for member in part.members)
        return Places(places, rounded(leader.place(part.leader))).encode_frames(self._port.node)

    def links_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        if not leader.links or not part.members or part.part + 1 < part.parts:
            return []
        frames = frames_of(leader.links)
        return [
            Links(self._port.node, links, part.term, leader.epoch, index, len(frames)).encode_frames()
            for index, links in enumerate(frames)
        ]

    def notice_ns(self, now_ns: int) -> int:
        return self._promises.notice_ns(now_ns)

    # --- at every node --------------------------------------------------------------------------------------------

    def read(self, packet: Packet, schedule: Schedule) -> Places | None:
        return decoded(packet.frame, Places.decode_frames) if schedule.members else None

    def on_schedule(self, packet: Packet, schedule: Schedule, places: Places | None, *, now_ns: int) -> None:
        """Take in the places, and plan when all of an epoch have come."""
        version = Version(Authority(schedule.term, schedule.leader), schedule.epoch)
        if version != self._membership.version or places is None or len(places.members) != len(schedule.members):
            return
        if version != self._version:
            self._version, self._schedules = version, {}
            if self._measured and _version_of(next(iter(self._measured.values()))) != version:
                self._measured = {}
        self._schedules[schedule.part] = schedule, places
        announced_ns = {version: packet.header.origin_us * US}
        if self._planned is not None and self._planned != version:
            announced_ns[self._planned] = self._announced_ns.get(self._planned, 0)
        self._announced_ns = announced_ns
        self._plan_if_complete(now_ns)

    def on_links(self, packet: Packet, *, now_ns: int) -> None:
        """Take in a part of the links of an assignment, which may come before the schedule does."""
        told = decoded(packet.frame, Links.decode_frames)
        if told is None or told.node != packet.header.origin:
            raise MalformedFrameError(f"links of an assignment by {packet.header.origin}")
        if any(max(link.a, link.b) > self._port.scenario.nodes.count for link in told.links):
            raise MalformedFrameError("links of nodes that are not there")
        version = _version_of(told)
        if version.authority != self._lease.authority:
            return
        if self._measured and _version_of(next(iter(self._measured.values()))) != version:
            self._measured = {}
        self._measured[told.part] = told
        if version == self._membership.version:
            self._refresh.keep(packet, _LINKS_PART + told.part, version.authority, version.epoch, now_ns=now_ns)
        self._plan_if_complete(now_ns)

    def _plan_if_complete(self, now_ns: int) -> None:
        """Plan once when all parts of the schedule's version have come, and all parts of its links."""
        version = self._version
        due = version is not None and version == self._membership.version and version != self._planned
        if due and self._is_complete():
            self._planned = version
            self._plan(now_ns)
        self._promises.announced_ns = 0 if self._planned is None else self._announced_ns.get(self._planned, 0)

    def _is_complete(self) -> bool:
        first = next(iter(self._schedules.values()))[0]
        return len(self._schedules) >= first.parts and self._has_links()

    def _has_links(self) -> bool:
        """True if all parts of the links of the schedule's version have come, or links are not measured."""
        if not self._port.scenario.measures_links:
            return True
        first = next(iter(self._measured.values()), None)
        return first is not None and _version_of(first) == self._version and len(self._measured) >= first.parts

    def _plan(self, now_ns: int) -> None:
        parts = [self._schedules[part] for part in sorted(self._schedules)]
        schedule, places = parts[0]
        at: dict[NodeId, Enu] = {NodeId(schedule.leader): places.leader}
        cluster_of: dict[NodeId, int] = {}
        heads: dict[int, NodeId] = {}
        for part, where in parts:
            for member, place in zip(part.members, where.members, strict=True):
                at[NodeId(member.node)] = place
                cluster_of[NodeId(member.node)] = member.cluster
                if member.is_head:
                    heads[member.cluster] = NodeId(member.node)
        if not heads.keys() >= set(cluster_of.values()):
            return  # a cluster without a head: no leader makes one
        measured = tuple(link for part in sorted(self._measured) for link in self._measured[part].links)
        head_of = {node: heads[cluster] for node, cluster in sorted(cluster_of.items())}
        found = self._fit(schedule, at, head_of, measured)
        # None: not one packet of each head fits; `fanet plan` says so
        plan = None if found is None else TurnPlan.of(self._port.node, schedule.start_us * US, found)
        self._access.follow(plan, now_ns=now_ns)

    def _fit(
        self, schedule: Schedule, at: Mapping[NodeId, Enu], head_of: Mapping[NodeId, NodeId], measured: tuple[Link, ...]
    ) -> Fitted | None:
        """The timetable; by places if links are not measured, or leave no room for the load."""
        places, leader = tuple(sorted(at.items())), NodeId(schedule.leader)
        origin_ns, period_ns = schedule.start_us * US, schedule.period_us * US
        found = None
        if measured:
            found = fit_measured(
                self._port.scenario,
                places,
                measured,
                leader=leader,
                origin_ns=origin_ns,
                link_parts=len(self._measured),
            )
        return found or fit(
            self._port.scenario, places, head_of, leader=leader, origin_ns=origin_ns, period_ns=period_ns
        )


def _version_of(links: Links) -> Version:
    return Version(Authority(links.term, NodeId(links.node)), links.epoch)
