"""The application contract: what a UAV does beside the network itself is done by applications, several on one node.

    start(port, now)       once, first; through the port it sends, flies and records from then on
    on_message(message, now)   a message for this node of a kind that the application listens to
    on_status(status, now)     what became of a message that it has sent
    on_fix, on_sensor, on_hello    readings of the vehicle's receivers, hellos of neighbors
    wake(now)              at or after the instant that `next_wake_ns()` named
    report()               counters, at any time

An application is sans-IO, as an actor is: it never sleeps, reads a clock, opens a socket or starts a thread, and
instants never decrease. So the same object runs in virtual time, over Zenoh and on a real radio. `next_wake_ns()` is
asked after each of these calls. `MalformedFrameError` raised in `on_message` and `on_hello` is counted as input that
makes no sense; anything else that is raised ends the node.
"""

from collections.abc import Collection, Mapping
from enum import StrEnum
from random import Random
from typing import Any, Final, NamedTuple, Protocol

from fanet_mw.bus.messages import Gps, SensorReading
from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, Enu, NodeId
from fanet_mw.wire import HEADER_BYTES, PRIORITY_BULK

ANY: Final[Collection[int]] = (-1,)
"""Stands for all ids or ports, except those of load whose content does not matter."""
HOME: Final = 0.0
"""The speed of a course that sends a UAV back to its formation."""


class Course(NamedTuple):
    """A command to the flight controller: fly there and hold; a speed of 0 means back to the formation."""

    position: Enu
    """The place to fly to [m]."""
    speed_m_s: float
    """The speed on the way there."""
    velocity: Enu | None = None
    """If given, the UAV flies at this velocity until the next command; the position is where that leads."""
    land: bool = False
    """True: it sinks straight down where it is, at the speed of the course, and stops its motors on the ground."""


class Received(NamedTuple):
    """One message as the application of another node sent it."""

    origin: NodeId
    """The node whose application has sent it."""
    destination: NodeId
    """The id of this node, or BROADCAST."""
    priority: int
    """1: safety, 2: report, 3: bulk; 0 is control traffic."""
    born_ns: int
    """The instant at which the application handed it over, by the origin's clock; never later than now."""
    hops: int
    """The number of transmissions that it took to get here."""
    frame: bytes
    """The packet as the radio delivered it, routing header first; of several packets the one that came last."""
    port: int = 0
    """The numbered port to which bytes were sent; 0 for MAVLink frames."""
    content: bytes | None = None
    """The bytes that were sent to a port; None for MAVLink frames."""

    @property
    def data(self) -> bytes:
        """What was sent: the bytes, or the MAVLink frames."""
        return self.frame[HEADER_BYTES:] if self.content is None else self.content

    def mavlink(self) -> list[Any]:
        """Its MAVLink messages, as objects of pymavlink; none if it was sent to a port.

        Raises MalformedFrameError, which `on_message` may let pass.
        """
        from fanet_mw.mavlink import decode  # pymavlink takes its time, and most messages are read without it

        return decode(self.data) if self.content is None else []


class Data(NamedTuple):
    """Bytes for the application that listens on a numbered port."""

    port: int
    """The port, 1 to 65535."""
    data: bytes
    """The bytes, which arrive as they are; they are sent in pieces when they are long."""


class Fate(StrEnum):
    """What has become of a message at its sender."""

    ADMITTED = "admitted"
    """The node has accepted the message."""
    REFUSED = "refused"
    """The node has not accepted it: the deadline cannot be kept, or too many messages wait (`Status.reason`)."""
    LET_OUT = "let_out"
    """Its first frame was announced to the radio."""
    SENT = "sent"
    """The radio has finished with its first frame."""
    TURNED_AWAY = "turned_away"
    """The radio did not try to send its first frame: its queue was full, or the frame came too late."""
    ACKNOWLEDGED = "acknowledged"
    """The application of a node (`Status.nodes`) has received it; reported once per node."""
    UNWANTED = "unwanted"
    """No application of that node listens to it."""
    EXPIRED = "expired"
    """Its lifetime is over; `Status.nodes` are the nodes that have not acknowledged it, if that was asked for."""
    DROPPED = "dropped"
    """It ended in this node; `Status.reason` says why."""


class Status(NamedTuple):
    """What became of the message with this handle."""

    handle: int
    """What `AppPort.send` returned."""
    fate: Fate
    """What has become of it."""
    t_ns: int
    """When it became so."""
    reason: DropReason | None = None
    """Why it was refused or dropped."""
    nodes: tuple[NodeId, ...] = ()
    """The nodes of which the fate is told."""
    last: bool = False
    """True if this is the last status of the message."""
    interval_ns: int | None = None
    """The least interval between messages that the network can serve in time; None when it is unknown."""


Destination = NodeId | Collection[NodeId]
"""One node, several, or BROADCAST."""


class AppPort(Protocol):
    """What a node offers to one of its applications."""

    @property
    def node(self) -> NodeId:
        """The id of this node."""

    @property
    def scenario(self) -> Scenario:
        """The scenario that this run follows."""

    @property
    def position(self) -> Enu:
        """The last position fix."""

    @property
    def velocity(self) -> Enu:
        """The velocity of the last fix [m/s]."""

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster as far as this node knows, by head, which is the first of them; empty where the
        routing protocol makes no clusters.
        """

    def send(
        self,
        content: object,
        *,
        destination: Destination = BROADCAST,
        priority: str | int = PRIORITY_BULK,
        confirm: bool = False,
        lifetime_ns: int | None = None,
        deadline_ns: int | None = None,
        born_ns: int | None = None,
    ) -> int:
        """Send a message of pymavlink, whole MAVLink frames as bytes, or `Data`, which are bytes to a port.

        Returned is the handle that statuses name. The priority is "safety", "report" or "bulk" (or 1 to 3).
        A message that is to be confirmed is sent again until each of its targets has it, and messages to the same
        targets, on one port and of one priority, are then handed over in order. Its lifetime is by default that of its
        priority in the scenario. A message with a deadline is refused if the network states that it cannot be kept.
        `born_ns` is when the application meant to send, by default now. Of plain MAVLink frames the handle is the
        packet's sequence number. Raises LocalProtocolError when it cannot be sent at all: content that is none of the
        three, frames that do not fit one packet, more bytes than 64 packets hold, a destination that is not another
        node of the scenario.
        """

    def fly(self, course: Course) -> None:
        """Command the vehicle. Of several commands during one call the last counts, and others may object to it."""

    def tap(self, frames: bytes) -> None:
        """Show MAVLink frames to the inspectors of this node."""

    def record(self, record: Record) -> None:
        """Write a record into the trace of the run."""

    def stream(self, use: str) -> Random:
        """The named random stream of this node for one use."""


class Application:
    """One application at one node."""

    name: str = "application"
    """A name that is unique at its node; the trace uses it for the application's packets."""
    listens: Collection[int] = ()
    """Ids of the MAVLink messages that it receives; the first inner frame decides what a packet counts as."""
    ports: Collection[int] = ()
    """Ports whose messages it receives."""
    follows: Collection[Fate] = ()
    """The fates of its messages that are reported to it."""
    port: AppPort
    """What the node offers, from `start` on."""

    def start(self, port: AppPort, now_ns: int) -> None:
        """The node has started."""
        self.port = port

    def on_message(self, message: Received, now_ns: int) -> None:
        """Take in a message for this node."""

    def on_status(self, status: Status, now_ns: int) -> None:
        """Take in what became of a message; only fates in `follows` are reported."""

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        """Take in a position fix of the vehicle's receiver."""

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        """Take in a reading of any other sensor that the scenario puts on board."""

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        """Take in a neighbor's hello, routing header first; it says where that neighbor flies."""

    def hello_frames(self, now_ns: int) -> bytes:
        """MAVLink frames to add to the hello that is sent now; it reaches neighbors sooner than any flood."""
        return b""

    def permits(self, course: Course, now_ns: int) -> bool:
        """True if a course that another application has commanded may be flown now. Who objects is asked about the next
        course too, and so knows what is wanted.
        """
        return True

    def wake(self, now_ns: int) -> None:
        """Act at an instant that `next_wake_ns` has named."""

    def next_wake_ns(self) -> int | None:
        """The instant of the next wake-up that is wanted; None when none is."""
        return None

    def report(self) -> Mapping[str, Any]:
        """Counters as JSON values, cumulative since `start`."""
        return {}
