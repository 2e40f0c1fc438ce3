"""Rejects schedules that no leader of this swarm would announce, such as forged ones, before they have any effect."""

from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.roles.leader import SETTLE_NS
from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import EPOCH_BITS, Membership
from fanet_mw.serial_number import newer
from fanet_mw.units import US, S
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
