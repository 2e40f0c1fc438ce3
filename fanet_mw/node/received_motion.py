"""Reads the position and velocity of another UAV out of a frame that this UAV has received."""

from typing import Final

from fanet_mw import mavlink
from fanet_mw.errors import MalformedFrameError
from fanet_mw.motion import Motion
from fanet_mw.node.reader import decoded, packet_of
from fanet_mw.units import MS, NodeId, S

FUTURE_NS: Final = S
"""What was sent by an instant further in the future than this is rejected: the clocks of a swarm differ by less."""


def motion_in(frame: bytes, *, own: NodeId, now_ns: int, place: mavlink.Geodetic) -> tuple[NodeId, Motion] | None:
    """The origin of a frame and its motion; None if malformed, without position, too far in the future, or `own`."""
    try:
        origin, heard = packet_of(frame).origin, decoded(frame, mavlink.kinematics_about(place))
    except MalformedFrameError:
        return None
    motion = Motion(heard.position, heard.velocity, heard.t_ms * MS)
    if origin == own or motion.at_ns > now_ns + FUTURE_NS:
        return None
    return origin, motion
