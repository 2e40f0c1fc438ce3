"""Where another UAV is and how it flies, by a frame that it has sent: a hello, or a position that it floods."""

from typing import Final

from fanet_mw import mavlink
from fanet_mw.errors import MalformedFrameError
from fanet_mw.motion import Motion
from fanet_mw.node.reader import decoded, packet_of
from fanet_mw.units import MS, NodeId, S

_FUTURE_NS: Final = S
"""A position of an instant further ahead is not believed, because clocks agree better than that."""


def motion_in(frame: bytes, *, own: NodeId, now_ns: int) -> tuple[NodeId, Motion] | None:
    """The origin of a frame and the motion of that UAV.

    None when the frame has no position, one of the future, or the `own` node for its origin.
    """
    try:
        origin, heard = packet_of(frame).origin, decoded(frame, mavlink.kinematics_of)
    except MalformedFrameError:
        return None
    motion = Motion(heard.position, heard.velocity, heard.t_ms * MS)
    if origin == own or motion.at_ns > now_ns + _FUTURE_NS:
        return None
    return origin, motion
