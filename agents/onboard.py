"""Connects the applications on board with the node and the vehicle: which application gets an input, where its output
goes.

    a message, a reading, a hello  ->  the applications that listen to it, in their order (`listeners.py`)
    a message that one sends       ->  the node, at once (`messenger.py`)
    a course that one commands     ->  the vehicle, once all have had the same input

The last command of each application counts, and no other application may object to it, unless it avoids a collision.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from random import Random
from typing import Any, Final

from agents.listeners import Callbacks, Listeners
from agents.messenger import Messenger
from agents.submission import MOST_PORT, Sending, Submission, is_port, positive, priority_of, require_frames
from fanet_mw import wire
from fanet_mw.actor import require_instant
from fanet_mw.application import ANY, Application, Course, Destination, Fate, Received
from fanet_mw.bus.messages import Gps, SensorReading
from fanet_mw.errors import DropReason, LocalProtocolError, MalformedFrameError
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.part_failure import is_ours, report_of
from fanet_mw.part_signature import misfit
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record, require_record
from fanet_mw.units import BROADCAST, US, Enu, NodeId

_MOST_MESSAGE_ID: Final = (1 << 24) - 1
"""MAVLink 2: ids have three bytes."""
_LONGEST_NAME: Final = 64
_OF_MESSENGER: Final = {
    wire.MESSAGE.msgid: lambda messenger: messenger.piece,
    wire.TARGETS.msgid: lambda messenger: messenger.piece,
    wire.RECEIPT.msgid: lambda messenger: messenger.receipts,
}
"""The messenger's method for a packet, by the id of the message with which the packet begins."""


class Onboard:
    """The applications of one node, with their inputs and outputs."""

    def __init__(
        self,
        node: Node,
        vehicle: Callable[[], tuple[Enu, Enu]],
        applications: Sequence[Application],
        *,
        fly: Callable[[Course, int], None],
        tap: Callable[[bytes, int], None],
    ) -> None:
        """`vehicle` gives position and velocity; `fly` and `tap` take a course or frames, and an instant."""
        for application in applications:
            _require_application(application)
        names = [application.name for application in applications]
        if len(set(names)) < len(names):
            raise LocalProtocolError(f"applications {names} of node {node.node}: each name must be there once")
        self.node = node
        self.vehicle = vehicle
        self.tap = tap
        self.now_ns = 0
        self.called = False
        """True once an application was called, because it may have commanded a course or may want another wake-up."""
        self._applications = tuple(applications)
        self._callbacks = Callbacks.of(applications)
        self._listeners = Listeners(applications)
        node.listened = self._listeners.wanted(also=_OF_MESSENGER)
        self._messenger = Messenger(node, self._listeners)
        self._fly = fly
        self._commanded: dict[str, Course] = {}
        """The courses that were commanded since the last input, by application."""

    @property
    def hears_hellos(self) -> bool:
        return bool(self._callbacks.on_hello)

    @property
    def owes_receipts(self) -> bool:
        """True while a message that was received has yet to be acknowledged."""
        return self._messenger.owes_receipts

    def start(self, now_ns: int) -> None:
        self._call(now_ns)
        self._messenger.start(now_ns)
        for application in self._applications:
            application.start(_ApplicationPort(self, application), now_ns)

    def messages(self) -> Mapping[str, Any]:
        """The counters of messages in pieces; empty if there were none."""
        return self._messenger.report()

    def report(self, names: Iterable[str]) -> Mapping[str, Any]:
        """The reports of these applications by name, without empty ones."""
        wanted = set(names)
        found = {a.name: report_of(a) for a in self._applications if a.name in wanted}
        return {name: report for name, report in found.items() if report}

    # --- input ----------------------------------------------------------------------------------------------------

    def _call(self, now_ns: int) -> None:
        self.now_ns, self.called = now_ns, True

    def deliver(self, packet: Packet, now_ns: int) -> None:
        """Pass a packet for this node to the applications that listen to it, mostly none."""
        frame = packet.frame
        message_id = int.from_bytes(frame[wire.INNER_ID], "little")
        if message_id in _OF_MESSENGER:
            self._guard(_OF_MESSENGER[message_id](self._messenger), packet, now_ns)
            self._call(now_ns)
            return
        listeners = self._listeners.of_message(message_id)
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
        self._call(now_ns)
        for application in self._callbacks.on_hello:
            self._guard(application.on_hello, frame, now_ns)

    def _guard(self, hear: Callable[[Any, int], None], what: object, now_ns: int) -> None:
        try:
            hear(what, now_ns)
        except MalformedFrameError:
            self.node.dropped[DropReason.MALFORMED] += 1

    def operator(self, frames: bytes, now_ns: int) -> None:
        self._call(now_ns)
        for application in self._callbacks.on_operator:
            self._guard(application.on_operator, frames, now_ns)

    def record(self, by: Application, record: Record) -> None:
        """Write a record into the trace, and let the other applications know."""
        self.node.records.append(record)
        for application in self._callbacks.on_record:
            if application is not by:
                application.on_record(record, self.now_ns)

    def fix(self, fix: Gps, now_ns: int) -> None:
        self._call(now_ns)
        for application in self._callbacks.on_fix:
            application.on_fix(fix, now_ns)

    def sensor(self, reading: SensorReading, now_ns: int) -> None:
        self._call(now_ns)
        for application in self._callbacks.on_sensor:
            application.on_sensor(reading, now_ns)

    def hello_frames(self, room: int, now_ns: int) -> bytes:
        """The inner frames that applications add to the next hello, at most `room` bytes."""
        added = b""
        for application in self._callbacks.hello_frames:
            frames = application.hello_frames(now_ns)
            if not is_ours(application) and frames != b"":
                require_frames(frames, most=room - len(added), who=f"{_said(application)}: hello_frames()")
            added += frames
        return added

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        """Wake the applications whose instant has come."""
        self._call(now_ns)
        for application in self._callbacks.next_wake_ns:
            due_ns = application.next_wake_ns()
            if due_ns is not None and due_ns <= now_ns:
                application.wake(now_ns)
        due_ns = self._messenger.next_wake_ns()
        if due_ns is not None and due_ns <= now_ns:
            self._messenger.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        first_ns = self._messenger.next_wake_ns()
        for timed in self._callbacks.next_wake_ns:
            wake_ns = timed.next_wake_ns()
            if wake_ns is not None and wake_ns.__class__ is not int:  # NaN would be lost among the others
                require_instant(wake_ns, who=f"{_said(timed)} of node {self.node.node}")
            if wake_ns is not None and (first_ns is None or wake_ns < first_ns):
                first_ns = wake_ns
        return first_ns

    def due(self, now_ns: int) -> list[str]:
        """The applications that want to be woken by now, by name."""
        asked = [(timed, timed.next_wake_ns()) for timed in self._callbacks.next_wake_ns]
        return [_said(timed) for timed, wake_ns in asked if wake_ns is not None and wake_ns <= now_ns]

    # --- output ---------------------------------------------------------------------------------------------------

    def send(self, application: Application, submission: Submission) -> int:
        return self._messenger.send(application, submission, now_ns=self.now_ns)

    def command(self, application: Application, course: Course) -> None:
        self._commanded[application.name] = course

    def settle(self, now_ns: int) -> None:
        """Hand over complete messages, report on sent ones, and fly the commanded course."""
        self._call(now_ns)  # news of the node alone may have led here, and an application that hears them may send
        if self._messenger.has_news():  # most inputs bring none
            for application, message in self._messenger.arrived():
                self._guard(application.on_message, message, now_ns)
            for application, status in self._messenger.statuses(now_ns):
                application.on_status(status, now_ns)
        if self._commanded:
            self._fly_commanded(now_ns)

    def _fly_commanded(self, now_ns: int) -> None:
        commanded, self._commanded = self._commanded, {}
        for application in self._applications:
            course = commanded.get(application.name)
            if course is None:
                continue
            judges = () if application.avoids else self._callbacks.permits
            objections = [o for o in judges if o is not application and not o.avoids and not o.permits(course, now_ns)]
            # whoever avoids collisions flies the course later that it has judged last
            objections = objections or [o for o in judges if o.avoids and not o.permits(course, now_ns)]
            if not objections:
                self._fly(course, now_ns)


class _ApplicationPort:
    """The port of one application (`fanet_mw.application.AppPort`)."""

    def __init__(self, onboard: Onboard, application: Application) -> None:
        self._onboard = onboard
        self._application = application
        self._sending = Sending(onboard.node.node, onboard.node.scenario.node_count)
        self.node: NodeId = onboard.node.node
        self.scenario: Scenario = onboard.node.scenario

    @property
    def position(self) -> Enu:
        return self._onboard.vehicle()[0]

    @property
    def velocity(self) -> Enu:
        return self._onboard.vehicle()[1]

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        return self._onboard.node.clusters()

    def send(
        self,
        content: object,
        *,
        destination: Destination = BROADCAST,
        priority: str | int = wire.PRIORITY_BULK,
        confirm: bool = False,
        lifetime_ns: int | None = None,
        deadline_ns: int | None = None,
        born_ns: int | None = None,
    ) -> int:
        now_ns = self._onboard.now_ns
        born_ns = now_ns if born_ns is None else min(born_ns, now_ns)
        port, data = self._sending.content(content)
        to, targets = self._sending.whom(destination)
        submission = Submission(
            port, data, to, targets, priority_of(priority), confirm,
            positive("lifetime_ns", lifetime_ns),
            positive("deadline_ns", deadline_ns),
            born_ns,
        )  # fmt: skip
        return self._onboard.send(self._application, submission)

    def fly(self, course: Course) -> None:
        if not isinstance(course, Course) or not _is_flyable(course):
            raise LocalProtocolError(
                f"{_said(self._application)}: course = {course!r} must be a Course of finite numbers"
            )
        self._onboard.command(self._application, course)

    def record(self, record: Record) -> None:
        if not is_ours(self._application):
            require_record(record, who=_said(self._application))
        self._onboard.record(self._application, record)

    def tap(self, frames: bytes) -> None:
        if not is_ours(self._application):
            require_frames(frames, who=f"{_said(self._application)}: tap()")
        self._onboard.tap(frames, self._onboard.now_ns)

    def stream(self, use: str) -> Random:
        return stream(self.scenario.seed, use, self.node)


def _is_flyable(course: Course) -> bool:
    places = [course.position] if course.velocity is None else [course.position, course.velocity]
    if not all(isinstance(place, Enu) for place in places):
        return False
    try:
        return all(map(math.isfinite, (*places[0], *places[-1], course.speed_m_s)))
    except TypeError:
        return False


def _said(application: Application) -> str:
    """How an application is named in an error."""
    return f"application {application.name!r} ({type(application).__module__}:{type(application).__qualname__})"


def _require_application(application: Application) -> None:
    """Raise LocalProtocolError for attributes that mean nothing, and methods that cannot be called."""
    name = application.name
    if not isinstance(name, str) or not (0 < len(name) <= _LONGEST_NAME and name.isprintable()):
        raise LocalProtocolError(
            f"{_said(application)}: name must be text of 1 to {_LONGEST_NAME} printable characters"
        )
    if (wrong := misfit(type(application), Application)) is not None:  # type: ignore[arg-type]  # a class is hashable
        raise LocalProtocolError(f"{_said(application)} {wrong}")
    _require_collection(
        application, "ports", all(map(is_port, _members(application.ports))), f"numbers in [1, {MOST_PORT}]"
    )
    known = all(type(i) is int and 0 <= i <= _MOST_MESSAGE_ID for i in _members(application.listens))
    _require_collection(application, "listens", known, f"ids of messages in [0, {_MOST_MESSAGE_ID}]")
    _require_collection(
        application, "follows", all(fate in list(Fate) for fate in _members(application.follows)), "fates"
    )


def _members(told: object) -> Collection[object]:
    """The members of a collection; what is none has a member that nothing allows."""
    if told == ANY:
        return ()
    return told if isinstance(told, Collection) and not isinstance(told, str | bytes) else (None,)


def _require_collection(application: Application, attribute: str, known: bool, what: str) -> None:
    if not known:
        value = getattr(application, attribute)
        raise LocalProtocolError(f"{_said(application)}: {attribute} = {value!r:.120} must be a collection of {what}")
