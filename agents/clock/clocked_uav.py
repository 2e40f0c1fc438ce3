"""A UAV with an inaccurate clock of its own: all instants between the UAV and its host are converted.

    host: true time  |  own clock (`local_clock`)  |  swarm time as this node believes it (`swarm_time`)  |  UAV

The swarm time that the UAV is given never decreases. Until a node has learned it, the node receives no schedules, and
contends for the channel.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from agents.clock.local_clock import LocalClock, SteadyClock
from agents.clock.swarm_time import SwarmTime, swarm_time
from agents.hello_schedule import HelloTime
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.uav import NodeState, Uav
from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.application import Application
from fanet_mw.bus.messages import Gps, MavlinkTap, Message, Reception, SensorReading, Setpoint, TxRequest, TxStatus
from fanet_mw.node.node import AnnouncedHello
from fanet_mw.node.reader import Reader
from fanet_mw.scenario import Scenario
from fanet_mw.trace import ClockSampled, Delivered, Record
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire import Kind

_SAMPLE_NS: Final = S
"""The interval at which the true error of swarm time is recorded."""
_ROUNDING_NS: Final = 2 * US
"""Rounding may change an instant by this much on its way to the host and back; a wake-up within it counts as due."""


class _TimeInHellos:
    """Adds time beacons to the hellos of one UAV (`agents.hello_schedule.HelloTime`)."""

    def __init__(self, time: SwarmTime, local_now_ns: Callable[[], int]) -> None:
        self._time = time
        self._local_now_ns = local_now_ns

    def frames(self) -> bytes:
        return self._time.hello_frames(self._local_now_ns())

    def announced(self, hello: AnnouncedHello) -> None:
        self._time.announced(hello)


class ClockedUav(Actor):
    """A UAV that sees the world through a clock of its own."""

    def __init__(self, scenario: Scenario, node: NodeId, make: Callable[[HelloTime | None], Uav]) -> None:
        """`make`: makes the UAV, given what adds time beacons to its hellos."""
        clock = LocalClock(scenario.clock, seed=scenario.seed, node=node)
        self._clock = SteadyClock(clock) if scenario.clock.counter else clock
        self._time = swarm_time(scenario, node)
        self._uav = make(_TimeInHellos(self._time, self._local_now_ns) if self._time.in_hellos else None)
        super().__init__(self._uav.name, self._uav.subscriptions)
        self.slack_ns = self._uav.slack_ns
        self._node = node
        self._stamp_ns = scenario.clock.stamp_ns
        self._until_ns = scenario.duration_ns
        self._input_ns = 0
        self._shown_ns = 0
        """The swarm time that was last given to the UAV; it never goes back."""
        self._sample_ns = 0
        self._withheld = 0
        """The number of schedules that were received before the node had swarm time, and of hellos that were old."""

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._uav.outbox, self._uav.records = [], []
        self._sample_ns = -(-now_ns // _SAMPLE_NS) * _SAMPLE_NS
        self._begin(now_ns)
        self._time.start(self._clock.local_ns(now_ns))
        self._uav.start(self._advance_to(now_ns))
        self._hand_over(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        self._begin(now_ns)
        translated = self._translated(message, now_ns)
        if translated is not None:
            self._uav.receive(topic, translated, self._advance_to(now_ns))
        if isinstance(message, Reception) and isinstance(translated, Reception):
            self._hand_over(now_ns, known={translated.end_ns: message.end_ns}, ended_ns=message.end_ns)
        else:
            self._hand_over(now_ns)

    def wake(self, now_ns: int) -> None:
        self._begin(now_ns)
        self._time.pass_time(self._clock.local_ns(now_ns))
        while self._sample_ns <= now_ns:
            self._sample(self._sample_ns)
            self._sample_ns += _SAMPLE_NS
        wanted_ns, shown_ns = self._uav.next_wake_ns(), self._advance_to(now_ns)
        if wanted_ns is not None and wanted_ns <= shown_ns + _ROUNDING_NS:
            self._shown_ns = max(shown_ns, wanted_ns)
            self._uav.wake(self._shown_ns)
        self._hand_over(now_ns)

    def nudge(self, now_ns: int) -> None:
        self._begin(now_ns)
        self._uav.nudge(self._advance_to(now_ns))
        self._hand_over(now_ns)

    def state(self, now_ns: int) -> NodeState:
        return self._uav.state(self._advance_to(now_ns))

    def next_wake_ns(self) -> int | None:
        wanted_ns = self._uav.next_wake_ns()
        if wanted_ns is None:
            return self._sample_ns
        return min(self._sample_ns, self._true_ns(wanted_ns))

    def due(self, now_ns: int) -> list[str]:
        return self._uav.due(self._local_now_ns())

    def stop(self, now_ns: int) -> None:
        self._uav.stop(self._advance_to(now_ns))
        self._hand_over(now_ns)

    def report(self) -> Mapping[str, Any]:
        local_ns = self._clock.local_ns(self._sample_ns - _SAMPLE_NS)
        bound_ns = self._time.error_ns(local_ns)
        clock = {
            "synced": self._time.synced,
            "bound_us": None if bound_ns is None else bound_ns / US,
            "worst_us": self._time.worst_ns(local_ns) / US,
            "withheld": self._withheld,
            "jumps": self._clock.jumps if isinstance(self._clock, SteadyClock) else 0,
            **self._time.report(),
        }
        report = self._uav.report()
        # the UAV has not seen what was withheld from it, but this node has received it
        return {**report, "receptions": report["receptions"] + self._withheld, "clock": clock}

    # --- instants -------------------------------------------------------------------------------------------------

    def _begin(self, now_ns: int) -> None:
        self._input_ns = now_ns
        self._clock.pass_time(now_ns, until_ns=self._until_ns)

    def _local_now_ns(self) -> int:
        return self._clock.local_ns(self._input_ns)

    def _advance_to(self, now_ns: int) -> int:
        swarm_ns = self._time.line.swarm_ns(self._clock.local_ns(now_ns))
        self._shown_ns = max(self._shown_ns, swarm_ns)
        return self._shown_ns

    def _true_ns(self, swarm_ns: int) -> int:
        """The true instant at which the node believes it to be this swarm time."""
        return self._clock.true_ns(self._time.line.local_ns(swarm_ns))

    def _stamped_ns(self, true_ns: int) -> int:
        """The stamp that the node's own clock gives to a true instant, rounded down to the resolution of stamps."""
        return self._clock.local_ns(true_ns) // self._stamp_ns * self._stamp_ns

    # --- in -------------------------------------------------------------------------------------------------------

    def _translated(self, message: Message, now_ns: int) -> Message | None:
        if isinstance(message, Reception):
            ended_ns = self._stamped_ns(message.end_ns)
            kind = wire.peek_kind(message.frame)
            if kind == Kind.HELLO:
                local_ns = self._clock.local_ns(now_ns)
                if not self._time.on_hello(message.frame, message.src, ended_ns=ended_ns, local_ns=local_ns):
                    self._withheld += 1
                    return None
            elif kind == Kind.SCHEDULE and not self._time.synced:
                self._withheld += 1
                return None
            return message._replace(end_ns=self._time.line.swarm_ns(ended_ns))
        if isinstance(message, TxStatus):
            ended_ns = self._stamped_ns(message.end_ns)
            if self._time.on_status(message, ended_ns=ended_ns):
                return None
            return message._replace(end_ns=self._time.line.swarm_ns(ended_ns))
        if isinstance(message, Gps):
            self._time.fix(self._stamped_ns(message.t_ns), message.t_ns)
        if isinstance(message, Gps | SensorReading):
            return message._replace(t_ns=self._time.line.swarm_ns(self._stamped_ns(message.t_ns)))
        return message

    # --- out ------------------------------------------------------------------------------------------------------

    def _hand_over(self, now_ns: int, *, known: Mapping[int, int] = MappingProxyType({}), ended_ns: int = 0) -> None:
        """Pass on the UAV's output; `known`: true instants of those given to it, `ended_ns`: true end of the frame."""
        uav = self._uav
        for topic, message in uav.outbox:
            if type(message) is TxRequest:
                self.outbox.append((topic, self._request(message, now_ns)))
            elif isinstance(message, Setpoint | MavlinkTap):
                self.outbox.append((topic, message._replace(t_ns=now_ns)))
            else:
                self.outbox.append((topic, message))
        uav.outbox.clear()
        if uav.records:
            at = {self._shown_ns: now_ns, **known}
            self.records += [self._recorded(record, at, ended_ns=ended_ns) for record in uav.records]
            uav.records.clear()

    def _recorded(self, record: Record, at: Mapping[int, int], *, ended_ns: int) -> Record:
        """A record in true time; a delivery's last part, too: the time that the UAV is given may stand still in it."""
        known_ns = at.get(record.t_ns)
        true_ns = self._true_ns(record.t_ns) if known_ns is None else known_ns
        if isinstance(record, Delivered):
            return record._replace(t_ns=true_ns, handover_ns=true_ns - ended_ns)
        return record._replace(t_ns=true_ns)

    def _request(self, request: TxRequest, now_ns: int) -> TxRequest:
        start_ns = self._true_ns(request.start_ns)
        if 0 < now_ns - start_ns <= _ROUNDING_NS:
            start_ns = now_ns
        until_ns = self._true_ns(request.until_ns) if request.until_ns else 0
        return request._replace(start_ns=start_ns, until_ns=until_ns)

    def _sample(self, at_ns: int) -> None:
        """Record the true error of swarm time; give the protocol the greatest error of any clock that is known here."""
        local_ns = self._clock.local_ns(at_ns)
        bound_ns = self._time.error_ns(local_ns)
        reference, hops = self._time.reference_and_hops(local_ns)
        ahead_ns = self._time.line.swarm_ns(local_ns) - at_ns
        self.records.append(
            ClockSampled(at_ns, self._node, ahead_ns, -1 if bound_ns is None else bound_ns, reference, hops)
        )
        self._uav.know_clock_error(self._time.worst_ns(local_ns))


def make_uav(
    scenario: Scenario,
    node: NodeId,
    swarm: str,
    *,
    position: Enu,
    applications: Sequence[Application] = (),
    onboard_map: OnboardMap = NO_MAP,
    reader: Reader | None = None,
) -> Uav | ClockedUav:
    """Make a UAV by its scenario, with the host's clock or its own; `reader` is shared by all nodes of a run."""

    def make(hello_time: HelloTime | None = None) -> Uav:
        return Uav(
            scenario, node, swarm, position=position, applications=applications, onboard_map=onboard_map,
            hello_time=hello_time, reader=reader,
        )  # fmt: skip

    return ClockedUav(scenario, node, make) if scenario.clock.modelled else make()
