"""Checks that the decoders of several messages share: what fails one raises MalformedFrameError."""

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import Enu
from fanet_mw.wire.frame import ANY_NODE, LATEST_US, VERSION


def refuse_unless(holds: bool, what: str) -> None:
    if not holds:
        raise MalformedFrameError(what)


def require_sender(version: int, node: int, *, t_us: int = 0) -> None:
    if version != VERSION or not 0 < node < ANY_NODE or t_us > LATEST_US:
        raise MalformedFrameError(f"version {version}, node {node}, instant {t_us} us")


def place_within(east: float, north: float, up: float, *, most: float) -> Enu:
    """The vector of these components, each of which must be at most `most` away from 0."""
    found = Enu(east, north, up)
    if not found.is_within(most):
        raise MalformedFrameError(f"{east}, {north}, {up} must be within {most:g}")
    return found
