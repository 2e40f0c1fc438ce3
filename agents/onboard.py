"""The applications of one node: who is given what comes in, and where what they put out goes.

Messages go to those that listen to them, readings and hellos to all that want them, in the order of the applications.
What an application sends enters the node at once. A course that one commands is flown if no other objects, when all of
them have had the same input; of several courses of one application the last counts.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from random import Random
from typing import Any, Final

from agents.messenger import Messenger
from fanet_mw import wire
from fanet_mw.application import (
    ANY,
    Application,
    Course,
    Data,
    Destination,
    Fate,
    Received,
    SensorReading,
    Status,
)
from fanet_mw.bus.messages import Gps, TxStatus
from fanet_mw.errors import DropReason, LocalProtocolError, MalformedFrameError
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, US, Enu, NodeId, earliest

_RADIO_FATES: Final = frozenset((Fate.SENT, Fate.TURNED_AWAY))
_OF_MESSENGER: Final = {
    wire.MESSAGE.msgid: lambda messenger: messenger.piece,
    wire.TARGETS.msgid: lambda messenger: messenger.piece,
    wire.RECEIPT.msgid: lambda messenger: messenger.receipts,
}
"""What of the messenger a packet is for that begins with this message."""


INNER_ID: Final = slice(wire.HEADER_BYTES + 7, wire.HEADER_BYTES + 10)
"""Where a packet has the message id of its first inner frame."""


class Onboard:
    """The applications of one node."""

    def __init__(
        self,
        node: Node,
        vehicle: Callable[[], tuple[Enu, Enu]],
        applications: Sequence[Application],
        *,
        fly: Callable[[Course, int], None],
        tap: Callable[[bytes, int], None],
    ) -> None:
        """`vehicle` tells position and velocity; `fly` and `tap` are told what, and at which instant."""
        names = [application.name for application in applications]
        if len(set(names)) < len(names):
            raise LocalProtocolError(f"applications {names} of node {node.node}: each name must be there once")
        self.node = node
        self.vehicle = vehicle
        self.tap = tap
        self.now_ns = 0
        """The instant of the input that is being handled."""
        self.called = False
        """Set whenever an application has been called: it may have commanded a course, or want another wake-up."""
        self._fly = fly
        self._applications = tuple(applications)
        self._listeners: dict[int, list[Application]] = {}
        """By MAVLink message."""
        self._at_port: dict[int, list[Application]] = {}
        self._to_all = [application for application in applications if application.listens == ANY]
        self._at_all = [application for application in applications if application.ports == ANY]
        for application in applications:
            for message in application.listens:
                self._listeners.setdefault(message, []).append(application)
            for port in application.ports:
                self._at_port.setdefault(port, []).append(application)
        self._messenger = Messenger(node, self._listening)
        known = (*self._listeners, *_OF_MESSENGER)
        self.wanted = (
            None if self._to_all else frozenset(message.to_bytes(3, "little") for message in known if message >= 0)
        )
        """Ids of the messages that anyone listens to, as in a frame: most packets are for nobody; None: any."""
        self._on_fix = _overriding(applications, "on_fix")
        self._on_sensor = _overriding(applications, "on_sensor")
        self._on_hello = _overriding(applications, "on_hello")
        self._judges = _overriding(applications, "permits")
        self._hello_frames = _overriding(applications, "hello_frames")
        self._timed = _overriding(applications, "next_wake_ns")
        self._courses: dict[str, Course] = {}
        """What was commanded during this input, by application."""
        self._with_radio: dict[int, tuple[Application, int]] = {}
        """By transmit request: whose packet's first frame it is, and the packet's handle."""

    @property
    def hears_hellos(self) -> bool:
        return bool(self._on_hello)

    def _listening(self, port: int, message: int) -> Sequence[Application]:
        if port:
            return [*self._at_port.get(port, ()), *self._at_all]
        return [*self._listeners.get(message, ()), *self._to_all]

    def start(self, now_ns: int) -> None:
        self._call(now_ns)
        self._messenger.start(now_ns)
        for application in self._applications:
            application.start(_Port(self, application), now_ns)

    def messages(self) -> Mapping[str, Any]:
        """Counters of messages in pieces; nothing when there were none."""
        return self._messenger.report()

    def report(self, names: Iterable[str]) -> Mapping[str, Any]:
        """The reports of these applications, by their names; those that have nothing to say are left out."""
        wanted = set(names)
        found = {a.name: dict(a.report()) for a in self._applications if a.name in wanted}
        return {name: report for name, report in found.items() if report}

    # --- in -------------------------------------------------------------------------------------------------------

    def _call(self, now_ns: int) -> None:
        self.now_ns, self.called = now_ns, True

    def deliver(self, packet: Packet, now_ns: int) -> None:
        """A packet for this node; nobody listens to most."""
        frame = packet.frame
        at = wire.HEADER_BYTES + 7  # where the first inner frame has its message id
        message_id = int.from_bytes(frame[at : at + 3], "little")
        if message_id in _OF_MESSENGER:
            self._guard(_OF_MESSENGER[message_id](self._messenger), packet, now_ns)
            self._call(now_ns)
            return
        listeners = self._listeners.get(message_id)
        if self._to_all and message_id != wire.CHUNK.msgid:
            listeners = [*(listeners or ()), *self._to_all]
        if not listeners:
            return
        self._call(now_ns)
        header = packet.header
        message = Received(
            packet.origin, NodeId(header.destination), header.priority, min(header.origin_us * US, now_ns),
            header.hops + 1, frame,
        )  # fmt: skip
        for application in listeners:
            self._guard(application.on_message, message, now_ns)

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        """A neighbor's hello."""
        self._call(now_ns)
        for application in self._on_hello:
            self._guard(application.on_hello, frame, now_ns)

    def _guard(self, hear: Callable[[Any, int], None], what: object, now_ns: int) -> None:
        try:
            hear(what, now_ns)
        except MalformedFrameError:
            self.node.dropped[DropReason.MALFORMED] += 1

    def fix(self, fix: Gps, now_ns: int) -> None:
        self._call(now_ns)
        for application in self._on_fix:
            application.on_fix(fix, now_ns)

    def sensor(self, reading: SensorReading, now_ns: int) -> None:
        self._call(now_ns)
        for application in self._on_sensor:
            application.on_sensor(reading, now_ns)

    def radio_done(self, status: TxStatus, now_ns: int) -> bool:
        """How a transmit request ended; True when that was of interest to an application."""
        found = self._with_radio.pop(status.seq, None)
        if found is None:
            return False
        self._call(now_ns)
        application, handle = found
        fate = Fate.SENT if status.attempts else Fate.TURNED_AWAY
        if fate in application.follows:
            application.on_status(Status(handle, fate, now_ns), now_ns)
        return True

    def hello_frames(self, now_ns: int) -> bytes:
        """What applications add to the hello that goes out now."""
        return b"".join(application.hello_frames(now_ns) for application in self._hello_frames)

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        """Wake those whose instant has come."""
        self._call(now_ns)
        for application in self._timed:
            due_ns = application.next_wake_ns()
            if due_ns is not None and due_ns <= now_ns:
                application.wake(now_ns)
        due_ns = self._messenger.next_wake_ns()
        if due_ns is not None and due_ns <= now_ns:
            self._messenger.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        return earliest(self._messenger.next_wake_ns(), *[application.next_wake_ns() for application in self._timed])

    # --- out ------------------------------------------------------------------------------------------------------

    def send(
        self,
        application: Application,
        content: bytes | Data,
        *,
        destination: Destination,
        priority: int,
        confirm: bool,
        lifetime_ns: int | None,
        deadline_ns: int | None,
        born_ns: int | None,
    ) -> int:
        requests = self.node.frames_sent
        handle = self._messenger.send(
            application,
            content,
            destination=destination,
            priority=priority,
            confirm=confirm,
            lifetime_ns=lifetime_ns,
            deadline_ns=deadline_ns,
            born_ns=self.now_ns if born_ns is None else min(born_ns, self.now_ns),
            now_ns=self.now_ns,
        )
        if self.node.frames_sent > requests and not _RADIO_FATES.isdisjoint(application.follows):
            self._with_radio[requests] = application, handle
        return handle

    def settle(self, now_ns: int) -> None:
        """Hand over messages that have become whole, tell of those that were sent, and fly as was commanded."""
        for application, message in self._messenger.arrived():
            self._guard(application.on_message, message, now_ns)
        for application, status in self._messenger.statuses(now_ns):
            application.on_status(status, now_ns)
        self._steer(now_ns)

    def command(self, application: Application, course: Course) -> None:
        self._courses[application.name] = course

    def _steer(self, now_ns: int) -> None:
        """Fly as the applications have commanded since the last input, in their order, unless another objects."""
        if not self._courses:
            return
        courses, self._courses = self._courses, {}
        for application in self._applications:
            course = courses.get(application.name)
            if course is None:
                continue
            objections = [o for o in self._judges if o is not application and not o.permits(course, now_ns)]
            if not objections:
                self._fly(course, now_ns)


def _overriding(applications: Sequence[Application], method: str) -> tuple[Application, ...]:
    """Those that have this method of their own: the others need not be asked."""
    return tuple(a for a in applications if getattr(type(a), method) is not getattr(Application, method))


class _Port:
    """What one application is handed (`fanet_mw.application.AppPort`)."""

    def __init__(self, onboard: Onboard, application: Application) -> None:
        self._onboard = onboard
        self._application = application
        self.node: NodeId = onboard.node.node
        self.scenario: Scenario = onboard.node.scenario
        self.record: Callable[[Record], None] = onboard.node.records.append

    @property
    def position(self) -> Enu:
        return self._onboard.vehicle()[0]

    @property
    def velocity(self) -> Enu:
        return self._onboard.vehicle()[1]

    def send(
        self,
        content: bytes | Data,
        *,
        destination: Destination = BROADCAST,
        priority: int = wire.PRIORITY_BULK,
        confirm: bool = False,
        lifetime_ns: int | None = None,
        deadline_ns: int | None = None,
        born_ns: int | None = None,
    ) -> int:
        return self._onboard.send(
            self._application,
            content,
            destination=destination,
            priority=priority,
            confirm=confirm,
            lifetime_ns=lifetime_ns,
            deadline_ns=deadline_ns,
            born_ns=born_ns,
        )

    def fly(self, course: Course) -> None:
        self._onboard.command(self._application, course)

    def tap(self, frames: bytes) -> None:
        self._onboard.tap(frames, self._onboard.now_ns)

    def stream(self, use: str) -> Random:
        return stream(self.scenario.seed, use, self.node)
