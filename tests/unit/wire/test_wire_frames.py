"""Runs of MAVLink frames by their lengths alone, where a byte is missing or the order is wrong."""

import pytest

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import Encoder
from fanet_mw.units import BROADCAST, NodeId
from fanet_mw.wire import Header, Kind, filler

NATIVE = Encoder(NodeId(3)).heartbeat()
PACKET = Header(0, 1, 3, BROADCAST, 3, Kind.DATA, 8, 0, 3, 0).encode() + filler(40)


@pytest.mark.parametrize("missing", [1, 2, 5])
def test_a_frame_whose_last_byte_is_missing_is_no_frame(missing: int) -> None:
    assert list(wire.frames(NATIVE + NATIVE)) == [NATIVE, NATIVE]
    with pytest.raises(MalformedFrameError, match="ends beyond the end"):
        list(wire.frames((NATIVE + NATIVE)[:-missing]))


def test_a_bundle_begins_with_a_header() -> None:
    assert wire.unbundle(PACKET + PACKET) == [PACKET, PACKET]
    for data in (NATIVE + PACKET, NATIVE, b""):
        with pytest.raises(MalformedFrameError):
            wire.unbundle(data)
