"""The application contract: what a UAV does besides the network itself is done by applications, several on one node.

An application is sans-IO, as an actor is: it never sleeps, reads a clock, opens a socket or starts a thread, and
instants never decrease. The same object therefore runs in virtual time, over Zenoh and on a real radio.
`next_wake_ns()` is called after each other call. If `on_message` or `on_hello` raises `MalformedFrameError`, the input
is counted as malformed; any other exception ends the node.
"""

from collections.abc import Collection, Mapping
from enum import StrEnum
from random import Random
from types import ModuleType
from typing import Any, Final, NamedTuple, Protocol

from fanet_mw.bus.messages import Gps, SensorReading
from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, Enu, NodeId
from fanet_mw.wire import HEADER_BYTES, PRIORITY_BULK

ANY: Final[Collection[int]] = (-1,)
"""Stands for all ids or ports, except those of pure load, whose content does not matter."""
HOME: Final = 0.0
"""The speed of a course that sends a UAV back to its place in the formation."""


class Course(NamedTuple):
    """A command to the flight controller: fly to a place and hold it; a speed of 0 without a velocity means back to the
    formation.
    """

    position: Enu
    """The place to fly to [m]."""
    speed_m_s: float
    """The speed on the way."""
    velocity: Enu | None = None
    """If given, the UAV flies at this velocity until the next command; `position` is then a point on that way."""
    land: bool = False
    """True: the UAV lands where it is, at the speed of the course."""
    take_off: bool = False
    """True: the UAV climbs straight up to the height of `position` and stays there."""
    go_home: bool = False
    """True: the UAV flies to its start, and lands there (`SetpointKind.RETURN`)."""


class Received(NamedTuple):
    """One message from the application of another node."""

    origin: NodeId
    """The node whose application has sent it."""
    destination: NodeId
    """The id of this node, or BROADCAST."""
    priority: int
    """1: safety, 2: report, 3: bulk; 0 is control traffic."""
    born_ns: int
    """The instant at which the application sent it, by the origin's clock; never later than now."""
    hops: int
    """The number of transmissions on its way to this node."""
    frame: bytes
    """The packet as the radio delivered it, routing header first; for a message in several packets, the last one."""
    port: int = 0
    """The numbered port to which bytes were sent; 0 for MAVLink frames."""
    content: bytes | None = None
    """The bytes that were sent to a port; None for MAVLink frames."""

    @property
    def data(self) -> bytes:
        """The content: bytes, or MAVLink frames."""
        return self.frame[HEADER_BYTES:] if self.content is None else self.content

    def mavlink(self, dialect: ModuleType | None = None) -> list[Any]:
        """The MAVLink messages in it, as objects of pymavlink; none if it was sent to a port.

        `dialect`: a module that pymavlink has generated, for messages of your own. Raises
        MalformedFrameError, which `on_message` need not catch.
        """
        # imported only here, because pymavlink takes long to load and most messages are read without it
        from fanet_mw.mavlink import decode

        return decode(self.data, dialect) if self.content is None else []


class Data(NamedTuple):
    """Bytes for the application that listens on a numbered port."""

    port: int
    """The port, 1 to 65535."""
    data: bytes
    """The bytes, which arrive unchanged; long ones are sent in several pieces."""


class Fate(StrEnum):
    """What has become of a message, as its sender is told."""

    ADMITTED = "admitted"
    """The node has accepted the message."""
    REFUSED = "refused"
    """The node has refused the message: its deadline cannot be met, or too many messages wait (`Status.reason`)."""
    LET_OUT = "let_out"
    """Its first frame was announced to the radio."""
    SENT = "sent"
    """The radio has finished with its first frame."""
    TURNED_AWAY = "turned_away"
    """The radio did not try to send its first frame: the radio's queue was full, or the frame came too late."""
    ACKNOWLEDGED = "acknowledged"
    """The application of a node (`Status.nodes`) has received it; reported once per node."""
    UNWANTED = "unwanted"
    """It has reached a node (`Status.nodes`) on which no application listens to it."""
    EXPIRED = "expired"
    """Its lifetime is over; `Status.nodes` are the nodes that have not acknowledged it, if it was to be confirmed."""
    DROPPED = "dropped"
    """It ended in this node; `Status.reason` says why."""


class Status(NamedTuple):
    """What has become of the message with this handle."""

    handle: int
    """The handle that `AppPort.send` has returned."""
    fate: Fate
    """What has become of it."""
    t_ns: int
    """The instant of this fate."""
    reason: DropReason | None = None
    """Why it was refused or dropped."""
    nodes: tuple[NodeId, ...] = ()
    """The nodes to which the fate applies."""
    last: bool = False
    """True if no further status of the message will follow."""
    interval_ns: int | None = None
    """The least interval between messages that the network can deliver in time; None if it is unknown."""


Destination = int | Collection[int]
"""One node, several, or BROADCAST."""


class AppPort(Protocol):
    """The services of a node for one of its applications."""

    @property
    def node(self) -> NodeId:
        """The id of this node."""

    @property
    def scenario(self) -> Scenario:
        """The scenario of this run."""

    @property
    def position(self) -> Enu:
        """The last position fix."""

    @property
    def velocity(self) -> Enu:
        """The velocity of the last fix [m/s]."""

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster by its head, the head first, as far as this node knows; empty without clusters."""

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
        """Send a pymavlink message, whole MAVLink frames as bytes, or `Data` (bytes to a port).

        Returns the handle that statuses name; for plain MAVLink frames it is the packet's sequence number. The priority
        is "safety", "report" or "bulk" (or 1 to 3).

        With `confirm` the message is sent again until all its targets have it, or its lifetime is over. Confirmed
        messages to the same targets, on one port and of one priority, are handed over in the order of sending. The
        lifetime is by default that of the priority in the scenario. A message with a deadline is refused if the network
        states that the deadline cannot be met. `born_ns` is the instant at which the application meant to send, by
        default now.

        Raises LocalProtocolError for a message that can never be sent: other content, frames that do not fit one
        packet, more bytes than 64 packets hold, or a destination that is not another node of the scenario.
        """

    def fly(self, course: Course) -> None:
        """Command the vehicle. The last command in a call counts, and other applications may object to it."""

    def tap(self, frames: bytes) -> None:
        """Show MAVLink frames on the tap of this node, to ground stations and inspectors."""

    def record(self, record: Record) -> None:
        """Write a record into the trace of the run."""

    def stream(self, use: str) -> Random:
        """The named random stream of this node for one use."""


class Application:
    """One application at one node."""

    name: str = "application"
    """A name that is unique at its node; the trace uses it for the application's packets."""
    listens: Collection[int] = ()
    """The ids of the MAVLink messages that it receives; the first inner frame decides the id of a packet."""
    ports: Collection[int] = ()
    """The ports whose messages it receives."""
    avoids: bool = False
    """True: its courses avoid a collision, so that no other application may object to them."""
    follows: Collection[Fate] = ()
    """The fates of its messages that are reported to it."""
    port: AppPort
    """The node's services, available from `start` on."""

    def start(self, port: AppPort, now_ns: int) -> None:
        """The node has started."""
        self.port = port

    def on_message(self, message: Received, now_ns: int) -> None:
        """A message for this node was received."""

    def on_status(self, status: Status, now_ns: int) -> None:
        """A message of this application has come to one of the fates in `follows`."""

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        """The vehicle's receiver has given a position fix."""

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        """Any other sensor on board has given a reading."""

    def on_operator(self, frames: bytes, now_ns: int) -> None:
        """MAVLink frames of a ground station have come for this UAV, from its gateway."""

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        """A neighbor's hello was received, routing header first; it states the neighbor's position and velocity."""

    def hello_frames(self, now_ns: int) -> bytes:
        """MAVLink frames to add to the hello that is sent now; a hello reaches neighbors sooner than a flood."""
        return b""

    def on_record(self, record: Record, now_ns: int) -> None:
        """Another application on board has written a record into the trace."""

    def permits(self, course: Course, now_ns: int) -> bool:
        """True unless this application objects to another one's course; it is then asked about the next one, too."""
        return True

    def wake(self, now_ns: int) -> None:
        """The instant has come that `next_wake_ns` has returned."""

    def next_wake_ns(self) -> int | None:
        """The instant of the next wake-up; None if none is wanted."""
        return None

    def report(self) -> Mapping[str, Any]:
        """Counters as JSON values, cumulative since `start`."""
        return {}
