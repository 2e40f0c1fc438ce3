"""Messages on the bus: what goes in comes out, and garbage never gets further than one error."""

from array import array
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.bus import codecs, topics
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import (
    Altimeter,
    Battery,
    Call,
    Camera,
    CameraImage,
    ClockEpoch,
    ClockRequest,
    ClockState,
    Echo,
    FlightState,
    Gps,
    Inertial,
    LandingTarget,
    MavlinkTap,
    Message,
    Obstructions,
    Person,
    Poses,
    Radar,
    Reception,
    Report,
    Setpoint,
    SetpointKind,
    TraceBatch,
    TxOutcome,
    TxRequest,
    TxStatus,
    Voice,
    WifiScan,
    WindEstimate,
)
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, MishapKind, Partition, Restore
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.orders import Order, OrderKind
from fanet_mw.trace import Delivered, Detected, Generated
from fanet_mw.units import Enu, NodeId

instants = st.integers(-(2**63), 2**63 - 1)
u32 = st.integers(0, 2**32 - 1)
nodes = st.integers(0, 0xFFFF).map(NodeId)
doubles = st.floats(allow_nan=False)
singles = st.floats(allow_nan=False, width=32)
finite = st.floats(allow_nan=False, allow_infinity=False)
finite_singles = st.floats(allow_nan=False, allow_infinity=False, width=32)
vectors = st.builds(Enu, doubles, doubles, doubles)
finite_vectors = st.builds(Enu, finite, finite, finite)
words = st.text(st.characters(codec="utf-8", exclude_characters="\n\r"), max_size=20)


@st.composite
def poses(draw: st.DrawFn) -> Poses:
    ids = draw(st.lists(st.integers(1, 0xFFFF), max_size=5))
    states = draw(st.lists(doubles, min_size=6 * len(ids), max_size=6 * len(ids)))
    return Poses(draw(instants), array("H", ids), array("d", states))


def numbers(code: str, values: st.SearchStrategy[int], count: int) -> "st.SearchStrategy[array[int]]":
    return st.lists(values, min_size=count, max_size=count).map(lambda found: array(code, found))


records = st.one_of(
    st.builds(Delivered, *[instants] * 7),
    st.builds(Generated, instants, nodes, u32, words, u32),
    st.builds(Detected, instants, nodes, u32, finite),
)


def tuples(kind: type[Any], *fields: st.SearchStrategy[Any]) -> "st.SearchStrategy[tuple[Any, ...]]":
    """Rows of a reading."""
    return st.lists(st.builds(kind, *fields), max_size=4).map(tuple)


KINDS: dict[type[Any], st.SearchStrategy[Any]] = {
    TxRequest: st.builds(TxRequest, u32, instants, st.binary(max_size=50), nodes, st.booleans(), instants),
    Reception: st.builds(Reception, st.binary(max_size=50), nodes, instants, finite_singles),
    TxStatus: st.builds(TxStatus, u32, st.sampled_from(TxOutcome), instants, st.integers(0, 255)),
    Poses: poses(),
    Obstructions: st.builds(
        lambda t_ns, pairs, ground: Obstructions(
            t_ns, array("H", [node for pair in pairs for node in pair]), array("H", []), array("f", ground)
        ),
        instants,
        st.lists(st.tuples(nodes, nodes), max_size=5),
        st.lists(singles, max_size=5),
    ),
    Setpoint: st.builds(
        Setpoint,
        instants,
        finite_vectors,
        finite,
        st.sampled_from(SetpointKind),
        finite_vectors,
    ),
    Camera: st.builds(Camera, instants, tuples(Person, *[finite] * 3)),
    CameraImage: st.tuples(st.integers(0, 4), st.integers(0, 4)).flatmap(
        lambda size: st.builds(
            CameraImage,
            instants,
            *map(st.just, size),
            st.binary(min_size=3 * size[0] * size[1], max_size=3 * size[0] * size[1]),
        )
    ),
    Voice: st.builds(Voice, instants, tuples(Call, *[finite] * 4)),
    Radar: st.builds(Radar, instants, tuples(Echo, *[finite] * 5)),
    Altimeter: st.builds(Altimeter, instants, finite, st.none() | finite),
    Inertial: st.builds(Inertial, instants, finite_vectors),
    WindEstimate: st.builds(WindEstimate, instants, finite_vectors),
    LandingTarget: st.builds(LandingTarget, instants, finite_vectors),
    Battery: st.builds(Battery, instants, finite, finite, finite),
    FlightState: st.builds(
        FlightState,
        instants,
        finite,
        finite,
        finite,
        st.integers(0, 255),
        st.none() | finite,
        st.integers(0, (1 << 63) - 1),
    ),
    Gps: st.builds(Gps, instants, finite_vectors, finite_vectors),
    WifiScan: st.builds(WifiScan, instants, st.lists(st.tuples(u32, finite_singles), max_size=5).map(tuple)),
    MavlinkTap: st.builds(MavlinkTap, instants, st.binary(max_size=50)),
    TraceBatch: st.builds(TraceBatch, st.lists(records, max_size=5).map(tuple)),
    ClockEpoch: st.builds(
        ClockEpoch,
        instants,
        st.floats(0.01, 100),
        st.sampled_from(ClockState),
        instants,
        st.integers(0, 2**64 - 1),
        st.integers(0, 2**32 - 1),
        instants,
    ),
    ClockRequest: st.builds(ClockRequest, st.floats(1e-3, 100)),
    Degrade: st.builds(Degrade, words, nodes, nodes, st.booleans(), doubles, doubles, instants),
    Jam: st.builds(Jam, words, vectors, doubles, doubles, instants),
    Cut: st.builds(Cut, words, nodes, instants, st.booleans(), st.booleans()),
    Partition: st.builds(Partition, words, st.lists(nodes, max_size=5).map(tuple), st.tuples(*[doubles] * 4), instants),
    Mishap: st.builds(Mishap, words, nodes, st.sampled_from(MishapKind), vectors, instants),
    Restore: st.builds(Restore, words),
    Order: st.builds(Order, st.sampled_from(OrderKind), nodes, finite, finite, finite),
    LinkStats: st.integers(0, 4).flatmap(
        lambda n: st.builds(
            LinkStats,
            instants,
            instants,
            numbers("H", nodes, 2 * n),
            numbers("I", u32, COUNTS * n),
            numbers("q", instants, n),
        )
    ),
    Report: st.builds(Report, words, instants, st.text(st.characters(codec="utf-8"), max_size=50)),
}
messages: st.SearchStrategy[Message] = st.one_of(*KINDS.values())


def test_every_kind_of_message_is_drawn() -> None:
    assert set(KINDS) == set(codecs.CODES)


@pytest.mark.parametrize(
    "message",
    [
        TxRequest(0, 0, b"x", NodeId(1), wants_status=False, until_ns=2**63),
        TxRequest(0, -(2**63) - 1, b"x", NodeId(1), wants_status=False),
        Cut("node-1", NodeId(1), 2**63),
        Partition("partition", (NodeId(2**16),), (0.0, 0.0, 0.0, 0.0)),
        Partition("partition", (), (0.0, 0.0, 0.0, 0.0), 2**63),
        WifiScan(0, ((-1, -80.0),)),
        Altimeter(2**63, 0.0, None),
    ],
)
def test_a_message_that_its_bytes_cannot_hold_is_named_where_it_is_put(message: Message) -> None:
    with pytest.raises(LocalProtocolError, match=f"^{type(message).__name__}.* cannot be put on the bus: "):
        codecs.encode([message])


@given(st.lists(messages, max_size=6))
def test_a_batch_is_decoded_as_it_was_encoded(batch: list[Message]) -> None:
    assert codecs.decode(codecs.encode(batch)) == batch


@given(st.binary(max_size=200))
def test_garbage_is_one_error_or_messages(data: bytes) -> None:
    with suppress(MalformedFrameError):
        codecs.decode(data)


@given(st.lists(messages, min_size=1, max_size=3), st.data())
def test_a_changed_byte_is_one_error_or_other_messages(batch: list[Message], data: st.DataObject) -> None:
    mutated = bytearray(codecs.encode(batch))
    at = data.draw(st.integers(0, len(mutated) - 1))
    mutated[at] ^= data.draw(st.integers(1, 255))
    with suppress(MalformedFrameError):
        codecs.decode(bytes(mutated))


@pytest.mark.parametrize(
    "reading",
    [
        Camera(0, (Person(0.0, float("nan"), 1.0),)),
        Voice(0, (Call(0.0, 0.0, float("inf"), 1.0),)),
        Radar(0, (Echo(float("nan"), 0.0, 0.0, 0.0, 0.0),)),
        Altimeter(0, float("nan"), None),
        Altimeter(0, 0.0, float("inf")),
        Inertial(0, Enu(0.0, float("nan"), 0.0)),
        Battery(0, 11.1, 5.0, float("nan")),
        FlightState(0, 0.0, float("inf"), 0.0),
        FlightState(0, 0.0, 0.0, 0.0, unix_ns=-1),
        WifiScan(0, ((1, -80.0), (2, float("nan")))),
        WifiScan(0, ((1, float("-inf")),)),
        Gps(0, Enu(0.0, float("nan"), 0.0), Enu(0.0, 0.0, 0.0)),
        Gps(0, Enu(0.0, 0.0, 0.0), Enu(0.0, 0.0, float("inf"))),
        Reception(b"x", NodeId(1), 0, float("nan")),
        Reception(b"x", NodeId(1), 0, float("inf")),
        Setpoint(0, Enu(float("nan"), 0.0, 0.0), 1.0),
        Setpoint(0, Enu(0.0, 0.0, 0.0), float("inf")),
        Setpoint(0, Enu(0.0, 0.0, 0.0), 1.0, SetpointKind.VELOCITY, Enu(0.0, 0.0, float("nan"))),
    ],
)
def test_a_reading_reception_or_setpoint_that_is_no_number_is_malformed(reading: Message) -> None:
    with pytest.raises(MalformedFrameError):
        codecs.decode(codecs.encode([reading]))


def test_the_node_of_a_topic_is_its_fourth_part() -> None:
    names = topics.Topics("swarm")
    assert topics.node_of(names.radio_tx(17)) == 17
    assert topics.node_of(names.setpoint(4)) == 4
    assert topics.node_of(names.pose) == 0
    assert topics.node_of("fanet/swarm/radio/²/tx") == 0
    assert topics.node_of(names.radio_tx("9" * 5000)) == 0, "Python refuses to read so long a number"


def test_a_trace_nested_deeper_than_a_parser_goes_is_malformed() -> None:
    body = b"[" * 200_000
    with pytest.raises(MalformedFrameError):
        codecs.decode(bytes([9]) + len(body).to_bytes(4, "little") + body)
