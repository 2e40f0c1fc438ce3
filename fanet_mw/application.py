"""The application contract: what a UAV carries, beside the network itself, is applications. Several run on one node.

    start(port, now)       once, first; through the port it sends, flies and records from then on
    on_message(message, now)   a message for this node that the application listens to
    on_status(status, now)     what became of a message that it sent
    on_fix, on_sensor, on_hello    what the vehicle's receivers and neighbors say
    wake(now)              at or after the instant that `next_wake_ns()` named
    report()               how it went, at any time

An application is sans-IO, as an actor is: it never sleeps, reads a clock, opens a socket or starts a thread, and
instants never decrease. So the same object runs in virtual time, over Zenoh and on a real radio. `next_wake_ns()` is
asked after each of these calls. `MalformedFrameError` raised in `on_message` and `on_hello` is counted as input that
makes no sense; anything else that is raised ends the node.
"""

from collections.abc import Collection, Mapping
from enum import StrEnum
from random import Random
from typing import Any, Final, NamedTuple, Protocol

from fanet_mw.bus.messages import Camera, Gps, WifiScan
from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, Enu, NodeId
from fanet_mw.wire import HEADER_BYTES, PRIORITY_BULK

ANY: Final[Collection[int]] = (-1,)
"""In place of ids or ports: all of them, but for load whose content does not matter."""
HOME: Final = 0.0
"""The speed of a course that sends a UAV back to its formation."""

SensorReading = WifiScan | Camera
"""Any reading of a sensor but the position fix; a further kind of sensor is a further member of this union."""


class Course(NamedTuple):
    """A command to the flight controller: fly there and hold; a speed of 0 means back to the formation."""

    position: Enu
    speed_m_s: float
    velocity: Enu | None = None
    """Fly at this velocity instead, until the next command; the position is where that leads."""


class Received(NamedTuple):
    """One message as the application of another node sent it."""

    origin: NodeId
    destination: NodeId
    """This node, or BROADCAST."""
    priority: int
    born_ns: int
    """When its application handed it over, by the origin's clock; never later than now."""
    hops: int
    frame: bytes
    """The packet as the radio brought it, routing header first; of several the one that made the message whole."""
    port: int = 0
    """The numbered port that bytes were sent to; 0: MAVLink frames."""
    content: bytes | None = None
    """The bytes that were sent to a port."""

    @property
    def data(self) -> bytes:
        """What was sent: the bytes, or the MAVLink frames."""
        return self.frame[HEADER_BYTES:] if self.content is None else self.content


class Data(NamedTuple):
    """Bytes for whoever listens on a numbered port."""

    port: int
    """1 to 65535."""
    data: bytes


class Fate(StrEnum):
    """What has become of a message at its sender."""

    ADMITTED = "admitted"
    """The node has taken it."""
    REFUSED = "refused"
    """The node has not taken it: the deadline cannot be kept, or too much waits already (`Status.reason`)."""
    LET_OUT = "let_out"
    """Its first frame was announced to the radio."""
    SENT = "sent"
    """The radio has done with its first frame."""
    TURNED_AWAY = "turned_away"
    """The radio did not try to send its first frame: its queue was full, or the frame came too late."""
    ACKNOWLEDGED = "acknowledged"
    """The application of a node (`Status.nodes`) has it; told of each node once."""
    UNWANTED = "unwanted"
    """No application of that node listens to it."""
    EXPIRED = "expired"
    """Its lifetime was over; `Status.nodes` are those that have not acknowledged it, where that was asked for."""
    DROPPED = "dropped"
    """It ended in this node; `Status.reason` says why."""


class Status(NamedTuple):
    """What became of the message with this handle."""

    handle: int
    fate: Fate
    t_ns: int
    reason: DropReason | None = None
    nodes: tuple[NodeId, ...] = ()
    last: bool = False
    """True when nothing more can become of it as far as this node will hear."""
    interval_ns: int | None = None
    """The least interval between messages that the network can serve in time; None: unknown."""


Destination = NodeId | Collection[NodeId]
"""One node, several, or BROADCAST."""


class AppPort(Protocol):
    """What a node offers to one of its applications."""

    @property
    def node(self) -> NodeId: ...

    @property
    def scenario(self) -> Scenario: ...

    @property
    def position(self) -> Enu:
        """The last position fix."""

    @property
    def velocity(self) -> Enu:
        """The velocity of the last fix [m/s]."""

    def send(
        self,
        content: bytes | Data,
        *,
        destination: Destination = BROADCAST,
        priority: int = PRIORITY_BULK,
        confirm: bool = False,
        lifetime_ns: int | None = None,
        deadline_ns: int | None = None,
        born_ns: int | None = None,
    ) -> int:
        """Send whole MAVLink frames, or bytes to a port; returns the handle that statuses name.

        A message that is to be confirmed is sent again until each of its targets has it, and messages to the same
        targets, on one port and of one priority, are then handed over in order. Its lifetime is by default that of its
        priority in the scenario. A message with a deadline is refused if the network states that it cannot be kept.
        `born_ns` is when the application meant to send, by default now. Of plain MAVLink frames the handle is the
        packet's sequence number. Raises LocalProtocolError when the content cannot be sent at all: frames that do not
        fit one packet, more bytes than 64 packets hold, a destination that is not in the scenario.
        """

    def fly(self, course: Course) -> None:
        """Command the vehicle. Of several commands during one call the last counts, and others may object to it."""

    def tap(self, frames: bytes) -> None:
        """Show MAVLink frames to whoever inspects this node."""

    def record(self, record: Record) -> None:
        """Write a record into the trace of the run."""

    def stream(self, use: str) -> Random:
        """The named random stream of this node for one use."""


class Application:
    """One application at one node."""

    name: str = "application"
    """Unique at its node; what the trace calls its packets."""
    listens: Collection[int] = ()
    """Ids of the MAVLink messages it is given: a packet counts as what its first inner frame is."""
    ports: Collection[int] = ()
    """Ports whose messages it is given."""
    follows: Collection[Fate] = ()
    """What it is told of its messages."""
    port: AppPort

    def start(self, port: AppPort, now_ns: int) -> None:
        """The node is up."""
        self.port = port

    def on_message(self, message: Received, now_ns: int) -> None:
        """A message for this node."""

    def on_status(self, status: Status, now_ns: int) -> None:
        """What became of a message; only the fates in `follows`."""

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        """Where the vehicle's receiver says it is."""

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        """What another sensor says."""

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        """A neighbor's hello, routing header first: it says where that neighbor flies."""

    def hello_frames(self, now_ns: int) -> bytes:
        """MAVLink frames for the hello that goes out now: it reaches neighbors sooner than any flood does."""
        return b""

    def permits(self, course: Course, now_ns: int) -> bool:
        """Whether a course that another application has commanded may be flown now."""
        return True

    def wake(self, now_ns: int) -> None:
        """An instant named by `next_wake_ns` has come."""

    def next_wake_ns(self) -> int | None:
        """When it wants to be woken; None: not at all."""
        return None

    def report(self) -> Mapping[str, Any]:
        """JSON-able counters, cumulative since `start`."""
        return {}
