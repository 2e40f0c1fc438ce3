"""What no leader of this swarm announces: asked of every schedule off the air before anything comes of it."""

from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.roles.leader import SETTLE_NS
from fanet_mw.routing.clustered.roles.lease import Authority
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.serial import newer
from fanet_mw.units import US, S
from fanet_mw.wire.inner import Schedule

_START_NS: Final = 60 * S
_START_PERIODS: Final = 100
"""A schedule that starts later than this minute and so many periods after it comes is forged: one of turns is
announced as long ahead as the bounds under the one before need, and those are some superframes."""
_EPOCHS: Final = 16
"""Epochs that may have been missed besides those for which there was time since the last."""


class ScheduleCheck:
    """What one node believes of schedules."""

    def __init__(self, port: Port, membership: Membership) -> None:
        self._port = port
        self._membership = membership
        self._renewed_ns = 0
        """The instant at which the schedule that the node follows last changed."""

    def on_new_schedule(self, now_ns: int) -> None:
        """The node follows another schedule."""
        self._renewed_ns = now_ns

    def check(self, schedule: Schedule, now_ns: int) -> None:
        """Raise MalformedFrameError for a schedule that cannot be meant."""
        scenario, epoch = self._port.scenario, schedule.epoch
        period_ns = scenario.clusters.period_ns
        period_us, slot_us = period_ns // US, period_ns // schedule.clusters // US
        if schedule.period_us != period_us or schedule.slot_us != slot_us:
            raise MalformedFrameError(f"slots of {schedule.slot_us} in {schedule.period_us} us, not {period_us} us")
        if schedule.start_us * US > now_ns + _START_PERIODS * period_ns + _START_NS:
            raise MalformedFrameError(f"a schedule from {schedule.start_us} us on")
        if any(member.node > scenario.nodes.count for member in schedule.members):
            raise MalformedFrameError(f"a schedule of nodes beyond {scenario.nodes.count}")
        known = self._membership.version
        if known is None or known.authority != Authority(schedule.term, schedule.leader):
            return
        most = _EPOCHS + (now_ns - self._renewed_ns) // min(period_ns, SETTLE_NS)
        ahead = (epoch - known.epoch) & 0xFFFF
        if epoch and newer(epoch, known.epoch, bits=16) and ahead > most:
            raise MalformedFrameError(f"epoch {epoch} after {known.epoch}: at most {most} can have been missed")
