"""How far a packet may travel."""

import pytest

from fanet_mw.node.packet import is_used_up
from fanet_mw.units import BROADCAST
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, Header, Kind, decode_header, rewrite

HEADER = Header(0, 1, 2, BROADCAST, 3, Kind.DATA, 8, 3, PRIORITY_BULK, FLAG_FLOOD)


@pytest.mark.parametrize(("hop_limit", "used_up"), [(0, True), (1, True), (2, False), (255, False)])
def test_a_packet_on_its_last_hop_is_not_passed_on(hop_limit: int, used_up: bool) -> None:
    assert is_used_up(HEADER._replace(hop_limit=hop_limit)) is used_up


@pytest.mark.parametrize(("hop", "left"), [(1, (7, 4)), (0, (8, 3))])
def test_each_hop_is_taken_from_the_hops_left_and_added_to_those_made(hop: int, left: tuple[int, int]) -> None:
    after = decode_header(rewrite(HEADER.encode(), 5, FLAG_FLOOD, hop=hop))
    assert (after.hop_limit, after.hops) == left


@pytest.mark.parametrize("hops", [254, 255])
def test_the_number_of_hops_made_stays_within_its_byte_whatever_a_frame_states(hops: int) -> None:
    frame = HEADER._replace(hops=hops).encode()
    assert decode_header(rewrite(frame, 5, FLAG_FLOOD)).hops == 255
