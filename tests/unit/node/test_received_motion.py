"""The motion of another UAV by a frame of that UAV: what is believed, and what is not."""

import pytest

from fanet_mw.mavlink import ORIGIN, Encoder
from fanet_mw.motion import Motion
from fanet_mw.node.reader import motion_in
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import PRIORITY_CONTROL, Header, Kind

OURS, THEIRS = NodeId(1), NodeId(2)
AT, VELOCITY = Enu(100.0, -50.0, 60.0), Enu(8.0, 0.0, -1.0)


def hello(*inner: bytes, t_ns: int) -> bytes:
    """A hello of the other UAV, born at an instant."""
    header = Header(t_ns // US, 0x8000_0000, THEIRS, BROADCAST, THEIRS, Kind.HELLO, 1, 0, PRIORITY_CONTROL, 0)
    return header.encode() + b"".join(inner)


def position(t_ns: int) -> bytes:
    return Encoder(THEIRS).global_position(AT, VELOCITY, yaw=None, now_ns=t_ns)


def test_a_hello_says_where_its_origin_is_how_it_flies_and_when_that_was() -> None:
    t_ns = 5 * S
    heard = motion_in(hello(position(t_ns), t_ns=t_ns), own=OURS, now_ns=t_ns + 20 * MS, place=ORIGIN)
    assert heard is not None
    origin, motion = heard
    assert (origin, motion.at_ns) == (THEIRS, t_ns)
    assert motion.position == pytest.approx(AT, abs=0.02)
    assert motion.velocity == pytest.approx(VELOCITY, abs=0.01)


@pytest.mark.parametrize(("ahead_ns", "is_believed"), [(S, True), (S + MS, False)])
def test_a_position_more_than_a_second_ahead_is_not_believed(ahead_ns: int, is_believed: bool) -> None:
    heard = motion_in(hello(position(9 * S + ahead_ns), t_ns=9 * S), own=OURS, now_ns=9 * S, place=ORIGIN)
    assert isinstance(heard and heard[1], Motion) is is_believed


def test_nobody_takes_a_frame_in_its_own_name_for_another_uav() -> None:
    assert motion_in(hello(position(9 * S), t_ns=9 * S), own=THEIRS, now_ns=9 * S, place=ORIGIN) is None


def test_a_frame_without_a_position_or_a_header_has_no_motion() -> None:
    assert motion_in(hello(t_ns=9 * S), own=OURS, now_ns=9 * S, place=ORIGIN) is None
    assert motion_in(b"not a frame", own=OURS, now_ns=9 * S, place=ORIGIN) is None
