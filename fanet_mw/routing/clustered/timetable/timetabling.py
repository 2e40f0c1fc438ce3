"""How nodes come to a timetable: all of them compute the same one from the schedule and the positions in it.

    parts of the schedule, with positions  ->  all parts of one version  ->  timetable, in force when that begins
    the measured links, if there are any   -'

The leader adds to each part of a schedule the positions of its members, and their loads if it hears them
(`clusters.load`), and floods the measured links after the last part.
"""

from collections.abc import Mapping
from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.node.reader import decoded
from fanet_mw.routing.clustered.roles.contract import PartDetails
from fanet_mw.routing.clustered.roles.leader import Leader
from fanet_mw.routing.clustered.roles.leader_election import Authority, Lease
from fanet_mw.routing.clustered.roles.membership import Membership, Version
from fanet_mw.routing.clustered.roles.schedule_check import ScheduleRefresh
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.stated_delays import StatedDelays
from fanet_mw.routing.clustered.timetable.turn_access import TurnAccess
from fanet_mw.routing.clustered.timetable.turn_allocation import fit, fit_measured
from fanet_mw.timesync.turn_slack import has_time
from fanet_mw.units import US, Enu, NodeId
from fanet_mw.wire.links import Link, Links, frames_of
from fanet_mw.wire.loads import AS_EXPECTED, Loads
from fanet_mw.wire.places import Places, rounded
from fanet_mw.wire.schedule import Schedule

_LINKS_PART: Final = 1 << 16
"""Added to the number of a part of the links, to tell it from parts of the schedule in the store."""


class FromPlaces:
    """Timetables computed from positions or from measured links, as the scenario says."""

    needs_every_link = True

    def __init__(
        self,
        port: Port,
        *,
        lease: Lease,
        membership: Membership,
        refresh: ScheduleRefresh,
        delays: StatedDelays,
        access: TurnAccess,
        followers: Followers,
    ) -> None:
        self._port = port
        self._lease = lease
        self._membership = membership
        self._refresh = refresh
        self._delays = delays
        self._access = access
        self._followers = followers
        self._schedules: dict[int, tuple[Schedule, PartDetails]] = {}
        self._measured: dict[int, Links] = {}
        self._version: Version | None = None
        self._planned: Version | None = None
        self._announced_ns: dict[Version, int] = {}
        """The instants of the leader's latest announcements of the newest schedule, and of the one that is followed."""

    # --- at the leader --------------------------------------------------------------------------------------------

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        if not part.members:
            return b""
        places = tuple(rounded(leader.place(member.node)) for member in part.members)
        frames = Places(places, rounded(leader.place(part.leader))).encode_frames(self._port.node)
        if not self._port.scenario.hears_load:
            return frames
        return frames + Loads(tuple(leader.load(member.node) for member in part.members)).encode_frames(self._port.node)

    def links_to_send_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        if not leader.links or not part.members or part.part + 1 < part.parts:
            return []
        frames = frames_of(leader.links)
        return [
            Links(self._port.node, links, part.term, leader.epoch, index, len(frames)).encode_frames()
            for index, links in enumerate(frames)
        ]

    def review(self, now_ns: int) -> None:
        """Who hears nobody in turns keeps no timetable: it would be taken for one that has what others flood."""
        if self._port.deaf or (self._planned is not None and self._delays.hears_nobody(now_ns)):
            self._planned = None  # the next announcement that is heard makes it anew
            self._access.give_up(now_ns)

    def must_show(self, now_ns: int) -> bool:
        return self._access.must_show(now_ns)

    def on_called_silent(self, node: NodeId, now_ns: int) -> None:
        self._followers.doubt(node, now_ns=now_ns)

    def notice_ns(self, now_ns: int) -> int:
        return self._delays.notice_ns(now_ns)

    def lost_ns(self, now_ns: int) -> Mapping[NodeId, int]:
        return self._delays.lost_ns(now_ns)

    # --- at every node --------------------------------------------------------------------------------------------

    def read(self, packet: Packet, schedule: Schedule) -> PartDetails | None:
        if not schedule.members:
            return None
        loads = decoded(packet.frame, Loads.decode_frames) if self._port.scenario.hears_load else None
        return PartDetails(decoded(packet.frame, Places.decode_frames), loads)

    def on_schedule(self, packet: Packet, schedule: Schedule, details: PartDetails | None, *, now_ns: int) -> None:
        version = Version(Authority(schedule.term, schedule.leader), schedule.epoch)
        if version != self._membership.version or details is None:
            return
        if any(len(told.members) != len(schedule.members) for told in details if told is not None):
            return
        if version != self._version:
            self._version, self._schedules = version, {}
            if self._measured and _version_of(next(iter(self._measured.values()))) != version:
                self._measured = {}
        self._schedules[schedule.part] = schedule, details
        announced_ns = {version: packet.header.origin_us * US}
        if self._planned is not None and self._planned != version:
            announced_ns[self._planned] = self._announced_ns.get(self._planned, 0)
        self._announced_ns = announced_ns
        self._compute_if_complete(now_ns)

    def on_links(self, packet: Packet, *, now_ns: int) -> None:
        told = decoded(packet.frame, Links.decode_frames)
        if told is None or told.node != packet.header.origin:
            raise MalformedFrameError(f"links of an assignment by {packet.header.origin}")
        if any(max(link.a, link.b) > self._port.scenario.node_count for link in told.links):
            raise MalformedFrameError("links of nodes that are not there")
        version = _version_of(told)
        if version.authority != self._lease.authority:
            return
        if self._measured and _version_of(next(iter(self._measured.values()))) != version:
            self._measured = {}
        self._measured[told.part] = told
        if version == self._membership.version:
            self._refresh.keep(packet, _LINKS_PART + told.part, version.authority, version.epoch, now_ns=now_ns)
        self._compute_if_complete(now_ns)

    def _compute_if_complete(self, now_ns: int) -> None:
        """Compute it once, when all parts of schedule and links are there, and the node has the swarm's time: without
        it, it would send in the turns of others.
        """
        version = self._version
        due = version is not None and version == self._membership.version and version != self._planned
        due = due and not self._port.deaf  # its own, as it leads in its opinion
        due = due and has_time(self._port.scenario.clock, clock_error_ns=self._port.clock_error_ns)
        if due and self._is_complete():
            self._planned = version
            self._compute(now_ns)
        self._delays.announced_ns = 0 if self._planned is None else self._announced_ns.get(self._planned, 0)

    def _is_complete(self) -> bool:
        first = next(iter(self._schedules.values()))[0]
        return len(self._schedules) >= first.parts and self._has_links()

    def _has_links(self) -> bool:
        """True if all parts of the links of this version have arrived, or if links are not measured."""
        if not self._port.scenario.measures_links:
            return True
        first = next(iter(self._measured.values()), None)
        return first is not None and _version_of(first) == self._version and len(self._measured) >= first.parts

    def _compute(self, now_ns: int) -> None:
        parts = [self._schedules[part] for part in sorted(self._schedules)]
        schedule, details = parts[0]
        at: dict[NodeId, Enu] = {NodeId(schedule.leader): details.places.leader}
        loads: dict[NodeId, int] = {}
        cluster_of: dict[NodeId, int] = {}
        heads: dict[int, NodeId] = {}
        for part, (where, sent) in parts:
            members = [NodeId(member.node) for member in part.members]
            told = zip(members, sent.members, strict=True) if sent is not None else ()
            loads |= {node: load for node, load in told if load != AS_EXPECTED}
            for member, place in zip(part.members, where.members, strict=True):
                at[NodeId(member.node)] = place
                cluster_of[NodeId(member.node)] = member.cluster
                if member.is_head:
                    heads[member.cluster] = NodeId(member.node)
        if not heads.keys() >= set(cluster_of.values()):
            return  # a cluster without a head; no leader announces one
        measured = tuple(link for part in sorted(self._measured) for link in self._measured[part].links)
        head_of = {node: heads[cluster] for node, cluster in sorted(cluster_of.items())}
        found = self._fit(schedule, at, head_of, measured, loads)
        # None if not even one packet of each head fits; `fanet plan` tells the user
        timetable = None
        if found is not None:
            version = Version(Authority(schedule.term, NodeId(schedule.leader)), schedule.epoch)
            timetable = NodeTimetable.of(self._port.node, schedule.start_us * US, found, version=version)
            self._followers.follow(version)
        self._access.follow(timetable, now_ns=now_ns)

    def _fit(
        self,
        schedule: Schedule,
        at: Mapping[NodeId, Enu],
        head_of: Mapping[NodeId, NodeId],
        measured: tuple[Link, ...],
        loads: Mapping[NodeId, int],
    ) -> FittedTimetable | None:
        """The timetable; from positions if links are not measured, or if they leave no room for the load."""
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
                loads=loads,
            )
        return found or fit(
            self._port.scenario, places, head_of, leader=leader, origin_ns=origin_ns, period_ns=period_ns, loads=loads
        )


def _version_of(links: Links) -> Version:
    return Version(Authority(links.term, NodeId(links.node)), links.epoch)
