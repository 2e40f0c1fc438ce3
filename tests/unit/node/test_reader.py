"""Reading a received frame: the result is the same for every receiver, whatever was read before."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node import duplicates
from fanet_mw.node.reader import BUNDLE, Decoded, Reader

FLOODED = wire.Header(5, 7, 3, 0xFFFF, 3, 0, 32, 0, 3, wire.FLAG_FLOOD)


def spoiled(frame: bytes, at: int) -> bytes:
    return frame[:at] + bytes((frame[at] ^ 0x40,)) + frame[at + 1 :]


FRAMES = [
    FLOODED.encode(),
    FLOODED._replace(origin=4).encode() + wire.filler(100),
    FLOODED._replace(origin=4, prev_hop=9, hops=1).encode() + wire.filler(100),
    FLOODED._replace(origin=4).encode() + wire.filler(101),
    FLOODED._replace(origin=4).encode() + wire.filler(100, node=2),
    FLOODED._replace(flags=0).encode(),
    FLOODED._replace(flags=wire.FLAG_TO_HEAD).encode(),
    FLOODED._replace(flags=wire.PHASE_MASK).encode(),
    spoiled(FLOODED.encode(), 0),
    spoiled(FLOODED.encode(), 12),
    b"",
]


def inner_frames(content: wire.Content) -> int:
    return len(content.inner)


def what(reader: Reader, frame: bytes) -> tuple[object, ...]:
    seen = reader.look(frame)
    try:
        return seen.hash, seen.fields, seen.phase, seen.packet or seen.read()
    except MalformedFrameError as error:
        return seen.hash, seen.fields, seen.phase, str(error)


@given(order=st.lists(st.sampled_from(FRAMES), max_size=12))
def test_what_is_read_of_a_frame_does_not_depend_on_what_was_read_before(order: list[bytes]) -> None:
    reader = Reader()
    assert [what(reader, frame) for frame in order] == [what(Reader(), frame) for frame in order]


def test_all_who_hear_one_frame_hold_one_packet() -> None:
    seen = Reader().look(FLOODED.encode())
    assert (seen.phase, seen.packet) == (duplicates.FLOODED, None)
    assert seen.read() is seen.packet
    assert seen.packet.header == FLOODED


def test_a_frame_with_several_packets_is_opened_once_and_holds_each_as_if_it_had_come_alone() -> None:
    reader, packets = Reader(), FRAMES[:2]
    seen = reader.look(wire.bundle(packets))
    assert (seen.phase, seen.hash) == (BUNDLE, 0)
    parts = reader.parts(seen)
    assert reader.parts(seen) is parts
    assert [(part.hash, part.phase) for part in parts] == [what(Reader(), frame)[::2][:2] for frame in packets]
    assert parts[1].read().frame == packets[1]


@pytest.mark.parametrize("frame", FRAMES[7:], ids=["two phases", "no header", "wrong CRC", "nothing"])
def test_a_frame_without_a_packet_is_named_each_time(frame: bytes) -> None:
    seen = Reader().look(frame)
    for _ in range(2):
        with pytest.raises(MalformedFrameError):
            seen.read()
        assert seen.packet is None


def test_what_was_decoded_of_one_packet_is_not_taken_for_another_s() -> None:
    made = Decoded()
    one, other = (FLOODED.encode() + wire.filler(size) for size in (17, 400))
    assert [made.of(frame, inner_frames) for frame in (one, other, one)] == [1, 2, 1]
    assert made.of(other, lambda content: content.inner[0][0]) == wire.CHUNK.msgid


def test_a_packet_is_decoded_once_whatever_was_decoded_in_between() -> None:
    """A radio that hands over several frames at once gives all of them to one node before the next has its turn."""
    made, found = Decoded(), []
    batch = [FLOODED.encode() + wire.filler(size) for size in range(20, 30)]
    for _ in range(3):
        for frame in batch:
            made.of(frame, found.append)
    assert len(found) == len(batch)
    for size in range(200, 500):
        made.of(FLOODED.encode() + wire.filler(size), found.append)
    made.of(batch[0], found.append)
    assert len(found) == len(batch) + 300 + 1, "what is old is forgotten"


def test_a_broken_packet_is_named_to_each_who_asks() -> None:
    made, frame = Decoded(), FLOODED.encode() + wire.filler(20)[:-1]
    for _ in range(2):
        with pytest.raises(MalformedFrameError):
            made.of(frame, inner_frames)


def test_copies_have_one_hash_and_other_packets_of_that_name_have_others_also_when_many_packets_came_between() -> None:
    reader = Reader()
    packet, copy, longer, forged = FRAMES[1:5]
    found = []
    for frame in (packet, copy, longer, forged, copy):
        found.append(reader.look(frame).hash)
        assert found[-1] == duplicates.hash_of(frame)
    assert found[0] == found[1] == found[4]
    assert len(set(found)) == 3
    for seq in range(2000):
        reader.look(FLOODED._replace(seq=seq).encode())
    assert reader.look(copy).hash == found[0]
    assert len(reader._hashes) < 1000
