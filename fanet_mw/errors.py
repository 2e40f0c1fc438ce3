"""What can go wrong, as types. What comes off the air is never one of these outside the actor that heard it."""

from enum import StrEnum


class FanetError(Exception):
    """The root: a message for a person, with the name, the value and the bound."""


class ConfigError(FanetError, ValueError):
    """A scenario or a flag is wrong; the message holds file, key, value and bound of every mistake."""


class ProtocolError(FanetError):
    """The root of what the sans-IO core raises."""


class LocalProtocolError(ProtocolError):
    """Our own caller broke a rule of the core: a bug, raised at once."""


class MalformedFrameError(ProtocolError):
    """Bytes off the air are no frame of ours; caught in the node and counted, never seen by a host."""


class HostError(FanetError):
    """The root of what hosts raise."""


class LateError(HostError):
    """Strict real time was asked for and the lateness went above its bound."""


class BusError(HostError, ConnectionError):
    """The Zenoh session could not be opened, or was lost."""


class DropReason(StrEnum):
    """Why a frame or a packet ended without being delivered. Closed: a new reason is a new member here."""

    # the radio and the channel
    COLLISION = "collision"
    """Overlapped by another audible frame at the receiver."""
    HALF_DUPLEX = "half_duplex"
    """The receiver was itself transmitting."""
    WEAK_SIGNAL = "weak_signal"
    """Noise, fading or obstruction: the error-rate model lost it."""
    NO_RECEIVER = "no_receiver"
    """No station was in range of a broadcast, or the unicast destination was not."""
    RETRY_LIMIT = "retry_limit"
    """Unicast given up after the last permitted attempt."""
    MAC_QUEUE_FULL = "mac_queue_full"
    MAC_LIFETIME = "mac_lifetime"
    """Waited in the MAC queue longer than its lifetime."""
    LATE = "late"
    """The transmit request reached the medium after the instant it asked for, beyond the bound."""
    STATION_DOWN = "station_down"
    """The sender or the receiver was cut off."""
    DEGRADED = "degraded"
    """Lost to a fault on the link (`[[faults]]`, `fanet air degrade`)."""
    JAMMED = "jammed"
    """Lost to noise from a jammer (`[[faults]]`, `fanet air jam`)."""
    BACKLOG = "backlog"
    """Announced while the medium already held as many requests of that node as it takes."""
    BUS = "bus"
    """Put on the bus and never seen by the other side (a gap in the sequence)."""
    # the node
    MALFORMED = "malformed"
    DUPLICATE = "duplicate"
    HOP_LIMIT = "hop_limit"
    QUEUE_FULL = "queue_full"
    """The bounded queue of the node evicted the least important packet."""
    EXPIRED = "expired"
    """Waited in the node beyond the packet's lifetime."""
    NO_ROUTE = "no_route"
    UNRESOLVED = "unresolved"
    """The address of its next hop was asked for in vain (`routing.address_resolution`)."""
    NOT_FOR_US = "not_for_us"
    UNKNOWN_NODE = "unknown_node"
    """Its header names a node that is not in the scenario."""
    FORGED = "forged"
    """Its header cannot be true: another transmitter than the radio's, a birth or a sequence number still to come."""
    OWN = "own"
    """In this node's own name, and not known to it: from before it started again, or forged."""
    TOO_LARGE = "too_large"
    """Longer than the radio's maximum frame."""
    MISSED_TURN = "missed_turn"
    """Heard so late that the turn in which it was to be relayed had begun; not relayed."""
    ADMISSION = "admission"
    """Came sooner than the node's bound allows if it is to meet `traffic.deadline_s`; refused at its origin."""
