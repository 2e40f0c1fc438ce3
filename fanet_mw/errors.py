"""The exceptions of this project, and the reasons for which frames and packets are dropped.

Received bytes never raise an exception outside of the actor that receives them.
"""

from enum import StrEnum


class FanetError(Exception):
    """The base class. Its message is written for a person, and has the name, the value and the bound."""


class ConfigError(FanetError, ValueError):
    """A scenario or a flag is wrong; the message holds file, key, value and bound of every mistake."""


class ProtocolError(FanetError):
    """The base class of the errors that the sans-IO core raises."""


class LocalProtocolError(ProtocolError):
    """The caller broke a rule of a contract: a bug of the program that calls, raised at once."""


class MalformedFrameError(ProtocolError):
    """Received bytes are not a valid frame; the node catches and counts this error, so a host never sees it."""


class HostError(FanetError):
    """The base class of the errors that hosts raise."""


class BusError(HostError, ConnectionError):
    """The Zenoh session could not be opened, or was lost."""


class DropReason(StrEnum):
    """Why a frame or a packet ended without being delivered. The set is closed: a new reason is a new member."""

    # the radio and the channel
    COLLISION = "collision"
    """The frame was overlapped by another audible frame at the receiver."""
    HALF_DUPLEX = "half_duplex"
    """The receiver was itself transmitting."""
    WEAK_SIGNAL = "weak_signal"
    """The error-rate model lost the frame to noise, fading or obstruction."""
    NO_RECEIVER = "no_receiver"
    """No station was in range of a broadcast, or the unicast destination was not."""
    RETRY_LIMIT = "retry_limit"
    """A unicast was given up after the last permitted attempt."""
    MAC_QUEUE_FULL = "mac_queue_full"
    """The MAC of the sender already held as many frames as it has room for."""
    MAC_LIFETIME = "mac_lifetime"
    """The frame waited in the MAC queue longer than its lifetime."""
    LATE = "late"
    """The transmit request reached the medium after the instant it asked for, by more than the bound."""
    STATION_DOWN = "station_down"
    """The sender or the receiver was cut off."""
    DEGRADED = "degraded"
    """The frame was lost to a fault on the link (`[[faults]]`, `fanet air degrade`)."""
    JAMMED = "jammed"
    """The frame was lost to noise from a jammer (`[[faults]]`, `fanet air jam`)."""
    BACKLOG = "backlog"
    """The request was announced while the medium already held as many requests of that node as it accepts."""
    REFUSED = "refused"
    """The radio can never send such a frame: it said so in the status of a unicast."""
    BUS = "bus"
    """The request was put on the bus and never reached the other side (a gap in the sequence)."""
    # the node
    MALFORMED = "malformed"
    """The bytes are no frame of this network, or a field is beyond its bound."""
    DUPLICATE = "duplicate"
    """The node had already handled this packet in this phase of its way."""
    HOP_LIMIT = "hop_limit"
    """The packet had crossed as many hops as a packet may."""
    QUEUE_FULL = "queue_full"
    """The bounded queue of the node evicted the least important packet."""
    EXPIRED = "expired"
    """The packet waited in the node beyond its lifetime."""
    NO_ROUTE = "no_route"
    """The protocol knew no next hop towards the destination."""
    UNRESOLVED = "unresolved"
    """The address of the next hop was requested in vain (`routing.address_resolution`)."""
    NOT_FOR_US = "not_for_us"
    """The frame was heard, and is addressed to another node."""
    UNKNOWN_NODE = "unknown_node"
    """The header names a node that is not in the scenario."""
    FORGED = "forged"
    """The header cannot be true: another transmitter than the radio's, a birth or a sequence number in the future."""
    OWN = "own"
    """The packet is in this node's own name and not known to it: from before a restart, or forged."""
    TOO_LARGE = "too_large"
    """The frame is longer than the radio's maximum."""
    MISSED_TURN = "missed_turn"
    """The packet came so late that the turn in which it was to be relayed had begun; it was not relayed."""
    OUT_OF_TURN = "out_of_turn"
    """The packet was heard in no turn of its flood, and so there was none in which to relay it."""
    ADMISSION = "admission"
    """The packet would have missed `traffic.deadline_s`, or made others miss it, and was refused at its origin."""
    BOUND_LOST = "bound_lost"
    """The packet could no longer be everywhere within the bound that its origin had stated for it, because the turns
    that it waited for were given up, or went to the announcements of a node that took office; it was not let out.
    """
