"""Checks what an application submits for sending, before anything is done with it.

A submission that can never be sent is a mistake of the program: LocalProtocolError, in the call that made it.
"""

from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

from fanet_mw import mavlink, wire
from fanet_mw.actor import is_whole
from fanet_mw.application import Data, Destination
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.units import BROADCAST, NodeId
from fanet_mw.wire.application_message import MAVLINK_PORT

MOST_PORT: Final = 0xFFFF
_PRIORITIES: Final[Mapping[str | int, int]] = {
    key: number for name, number in wire.PRIORITIES.items() for key in (name, number)
}


def is_port(port: object) -> bool:
    """True for the number of a port of an application."""
    return isinstance(port, int) and 0 < port <= MOST_PORT


class Submission(NamedTuple):
    """A checked message; only its length remains to be checked."""

    port: int
    """The number of the port; `MAVLINK_PORT` if `data` are MAVLink frames."""
    data: bytes
    to: NodeId
    targets: tuple[NodeId, ...]
    """The nodes that are addressed one by one; empty for a message to one node or to all."""
    priority: int
    confirm: bool
    lifetime_ns: int | None
    deadline_ns: int | None
    born_ns: int


class Sending(NamedTuple):
    """The node that sends, and the nodes of its swarm."""

    node: NodeId
    nodes: int

    def content(self, content: object) -> tuple[int, bytes]:
        """The port and the bytes of a submission: data for a port, MAVLink frames, or a pymavlink message."""
        if type(content) is bytes:  # as most are
            return MAVLINK_PORT, _as_frames(content)
        if isinstance(content, Data):
            port, data = content
            if not is_port(port):
                raise LocalProtocolError(f"port = {port!r} must be in [1, {MOST_PORT}]")
            if not isinstance(data, bytes | bytearray | memoryview):
                raise LocalProtocolError(f"content for port {port} must be bytes, not {type(data).__name__}")
            return port, bytes(data)
        if not isinstance(content, bytes | bytearray | memoryview):
            return MAVLINK_PORT, mavlink.packed(content, self.node)
        return MAVLINK_PORT, _as_frames(bytes(content))

    def whom(self, destination: Destination) -> tuple[NodeId, tuple[NodeId, ...]]:
        """The destination of the packets, and the nodes that are addressed one by one."""
        if destination == BROADCAST:
            return BROADCAST, ()
        nodes = (destination,) if isinstance(destination, int) else destination
        if not isinstance(nodes, Collection) or not all(isinstance(node, int) for node in nodes):
            raise LocalProtocolError(f"destination = {destination!r} must be a node id, several, or BROADCAST")
        others = sorted({NodeId(node) for node in nodes} - {self.node})
        if not others or not 0 < others[0] <= others[-1] <= self.nodes:
            known = f"BROADCAST, or ids in [1, {self.nodes}] of nodes other than {self.node}"
            raise LocalProtocolError(f"destination = {destination!r} must be {known}")
        return (others[0], ()) if len(others) == 1 else (BROADCAST, tuple(others))


@lru_cache(maxsize=64)
def _as_frames(content: bytes) -> bytes:
    try:
        whole = sum(1 for _ in wire.frames(content))
    except MalformedFrameError as error:
        raise LocalProtocolError(f"bytes without a port must be MAVLink 2 frames: {error}") from error
    if not whole:
        raise LocalProtocolError("bytes without a port must be MAVLink 2 frames, at least one")
    return content


def require_frames(frames: object, *, who: str, most: int | None = None) -> None:
    """Raise LocalProtocolError for what is no whole MAVLink frames, or longer than `most` bytes."""
    if not isinstance(frames, bytes):
        raise LocalProtocolError(f"{who}: MAVLink 2 frames must be bytes, not {frames!r:.80}")
    if most is not None and len(frames) > most:
        raise LocalProtocolError(f"{who}: {len(frames)} bytes must be <= {most}")
    try:
        for _ in wire.frames(frames):
            pass
    except MalformedFrameError as error:
        raise LocalProtocolError(f"{who}: {error}") from error


def priority_of(priority: str | int) -> int:
    """The number of a priority, given by name or by number."""
    number = _PRIORITIES.get(priority)
    if number is None:
        names = ", ".join(f"{name} ({number})" for name, number in wire.PRIORITIES.items())
        raise LocalProtocolError(f"priority = {priority!r} must be one of {names}")
    return number


def positive(name: str, duration_ns: int | None) -> int | None:
    """A duration, which must be positive; None if the application states none."""
    if duration_ns is not None and not (is_whole(duration_ns) and duration_ns > 0):
        raise LocalProtocolError(f"{name} = {duration_ns!r} must be a whole number of ns above 0")
    return duration_ns
