"""Rejects schedules that no leader of this swarm would announce, such as forged ones, before they have any effect.

A node whose neighbor follows an older schedule, or none, sends the newest one again (anti-entropy). So it reaches nodes
that missed the leader's floods: some come back to the swarm, and some, with a timetable, still use an older one.
Duplicates are suppressed as in Trickle (RFC 6206); a node refreshes only while it has heard of its leader recently
(`Lease.fresh`).
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.duplicates import key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.roles.leader import SETTLE_NS
from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import EPOCH_BITS, Membership
from fanet_mw.routing.packet_repair import AGAIN_NS, ASSESS_NS, FLOOD_OVER_NS
from fanet_mw.serial_number import newer
from fanet_mw.units import US, S
from fanet_mw.wire.hello.beacon import Beacon
from fanet_mw.wire.schedule import Schedule

_START_NS: Final = 60 * S
_START_PERIODS: Final = 100
"""A schedule is forged if it starts later than one minute and this number of periods after its arrival. Timetables are
announced some superframes ahead, as long as the delay bounds under the present one need."""
_EPOCHS: Final = 16
"""The number of epochs that may have been missed, in addition to those for which there was time."""


class ScheduleCheck:
    """The check at one node."""

    def __init__(self, port: Port, membership: Membership) -> None:
        self._port = port
        self._membership = membership
        self._renewed_ns = 0

    def on_new_schedule(self, now_ns: int) -> None:
        self._renewed_ns = now_ns

    def check(self, schedule: Schedule, now_ns: int) -> None:
        """Raise MalformedFrameError for a schedule that no leader would announce."""
        scenario, epoch = self._port.scenario, schedule.epoch
        period_ns = scenario.clusters.period_ns
        period_us, slot_us = period_ns // US, period_ns // schedule.clusters // US
        if schedule.period_us != period_us or schedule.slot_us != slot_us:
            raise MalformedFrameError(f"slots of {schedule.slot_us} in {schedule.period_us} us, not {period_us} us")
        if schedule.start_us * US > now_ns + _START_PERIODS * period_ns + _START_NS:
            raise MalformedFrameError(f"a schedule from {schedule.start_us} us on")
        count = scenario.node_count
        if any(member.node > count for member in schedule.members):
            raise MalformedFrameError(f"a schedule of nodes beyond {count}")
        known = self._membership.version
        if known is None or known.authority != Authority(schedule.term, schedule.leader):
            return
        most = _EPOCHS + (now_ns - self._renewed_ns) // min(period_ns, SETTLE_NS)
        ahead = (epoch - known.epoch) & 0xFFFF
        if epoch and newer(epoch, known.epoch, bits=EPOCH_BITS) and ahead > most:
            raise MalformedFrameError(f"epoch {epoch} after {known.epoch}: at most {most} can have been missed")


class ScheduleRefresh:
    """The newest schedule at one node, and when to send it again."""

    def __init__(self, random: Callable[[], float]) -> None:
        self._random = random
        self._version: tuple[Authority, int] | None = None
        self._packets: dict[int, Packet] = {}
        self._kept_ns = 0
        """No refresh is planned until `FLOOD_OVER_NS` after this instant."""
        self.due_ns: int | None = None
        self.pending: set[int] = set()
        """The keys of the packets that are to be sent again."""

    def keep(self, packet: Packet, part: int, authority: Authority, epoch: int, *, now_ns: int) -> None:
        """Keep a packet of the schedule that this node follows, or announces itself."""
        if (authority, epoch) != self._version:
            self._version, self._packets = (authority, epoch), {}
            self._kept_ns = now_ns  # at the first copy only: repetitions would else prevent a refresh
        self._packets[part] = packet
        self._plan(self.due_ns)

    def on_beacon(self, beacon: Beacon, *, now_ns: int) -> None:
        """A neighbor's beacon was received, which states the schedule that the neighbor follows."""
        if self._version is None or self.due_ns is not None or now_ns - self._kept_ns < FLOOD_OVER_NS:
            return
        authority, epoch = self._version
        theirs = Authority(beacon.term, beacon.leader)
        behind = not beacon.leader or theirs > authority
        if behind or (theirs == authority and newer(epoch, beacon.epoch, bits=EPOCH_BITS)):
            self._plan(now_ns + int(self._random() * ASSESS_NS))

    def _plan(self, due_ns: int | None) -> None:
        self.due_ns = due_ns
        self.pending.clear()
        if due_ns is not None:
            self.pending.update(map(key_of_packet, self._packets.values()))

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has flooded the schedule again, so this node need not."""
        if key in self.pending:
            self._over(now_ns)

    def due(self, *, now_ns: int) -> list[Packet]:
        """The packets to flood again now."""
        if self.due_ns is None or now_ns < self.due_ns:
            return []
        self._over(now_ns)
        return [self._packets[part] for part in sorted(self._packets)]

    def _over(self, now_ns: int) -> None:
        """A flood of the schedule has begun, here or elsewhere: plan nothing until it should be over."""
        self._plan(None)
        self._kept_ns = now_ns + AGAIN_NS - FLOOD_OVER_NS
