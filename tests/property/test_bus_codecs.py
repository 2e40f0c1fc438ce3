"""Messages on the bus: what goes in comes out, and garbage never gets further than one error."""

from array import array
from contextlib import suppress

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
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Restore
from fanet_mw.errors import MalformedFrameError
from fanet_mw.orders import Order, OrderKind
from fanet_mw.trace import Delivered, Detected, Generated
from fanet_mw.units import Enu, NodeId

instants = st.integers(-(2**63), 2**63 - 1)
u32 = st.integers(0, 2**32 - 1)
nodes = st.integers(0, 0xFFFF).map(NodeId)
doubles = st.floats(allow_nan=False)
singles = st.floats(allow_nan=False, width=32)
vectors = st.builds(Enu, doubles, doubles, doubles)
words = st.text(st.characters(codec="utf-8", exclude_characters="\n\r"), max_size=20)


@st.composite
def poses(draw: st.DrawFn) -> Poses:
    ids = draw(st.lists(st.integers(1, 0xFFFF), max_size=5))
    states = draw(st.lists(doubles, min_size=6 * len(ids), max_size=6 * len(ids)))
    return Poses(draw(instants), array("H", ids), array("d", states))


def numbers(code: str, values: st.SearchStrategy[int], count: int) -> "st.SearchStrategy[array[int]]":
    return st.lists(values, min_size=count, max_size=count).map(lambda found: array(code, found))


finite = st.floats(allow_nan=False, allow_infinity=False)
records = st.one_of(
    st.builds(Delivered, *[instants] * 7),
    st.builds(Generated, instants, nodes, u32, words, u32),
    st.builds(Detected, instants, nodes, u32, finite),
)
messages: st.SearchStrategy[Message] = st.one_of(
    st.builds(TxRequest, u32, instants, st.binary(max_size=50), nodes, st.booleans()),
    st.builds(Reception, st.binary(max_size=50), nodes, instants, singles),
    st.builds(TxStatus, u32, st.sampled_from(TxOutcome), instants, st.integers(0, 255)),
    poses(),
    st.builds(
        lambda t_ns, pairs, ground: Obstructions(
            t_ns, array("H", [node for pair in pairs for node in pair]), array("H", []), array("f", ground)
        ),
        instants,
        st.lists(st.tuples(nodes, nodes), max_size=5),
        st.lists(singles, max_size=5),
    ),
    st.builds(Setpoint, instants, vectors, doubles, st.sampled_from(SetpointKind), vectors),
    st.builds(Camera, instants, st.lists(st.builds(Person, *[finite] * 3), max_size=4).map(tuple)),
    st.tuples(st.integers(0, 4), st.integers(0, 4)).flatmap(
        lambda size: st.builds(
            CameraImage,
            instants,
            *map(st.just, size),
            st.binary(min_size=3 * size[0] * size[1], max_size=3 * size[0] * size[1]),
        )
    ),
    st.builds(Voice, instants, st.lists(st.builds(Call, *[finite] * 4), max_size=4).map(tuple)),
    st.builds(Radar, instants, st.lists(st.builds(Echo, *[finite] * 5), max_size=4).map(tuple)),
    st.builds(Altimeter, instants, finite, st.none() | finite),
    st.builds(Inertial, instants, st.builds(Enu, finite, finite, finite)),
    st.builds(WindEstimate, instants, st.builds(Enu, finite, finite, finite)),
    st.builds(Battery, instants, finite, finite, finite),
    st.builds(
        FlightState,
        instants,
        finite,
        finite,
        finite,
        st.integers(0, 255),
        st.none() | finite,
        st.integers(0, (1 << 63) - 1),
    ),
    st.builds(Gps, instants, vectors, vectors),
    st.builds(WifiScan, instants, st.lists(st.tuples(u32, singles), max_size=5).map(tuple)),
    st.builds(MavlinkTap, instants, st.binary(max_size=50)),
    st.builds(TraceBatch, st.lists(records, max_size=5).map(tuple)),
    st.builds(
        ClockEpoch,
        instants,
        st.floats(0.01, 100),
        st.sampled_from(ClockState),
        instants,
        st.integers(0, 2**64 - 1),
        st.integers(0, 2**32 - 1),
        instants,
    ),
    st.builds(ClockRequest, st.floats(1e-3, 100)),
    st.builds(Degrade, words, nodes, nodes, st.booleans(), doubles, doubles, instants),
    st.builds(Jam, words, vectors, doubles, doubles, instants),
    st.builds(Cut, words, nodes, instants),
    st.builds(Restore, words),
    st.builds(Order, st.sampled_from(OrderKind), nodes, finite, finite, finite),
    st.integers(0, 4).flatmap(
        lambda n: st.builds(
            LinkStats,
            instants,
            instants,
            numbers("H", nodes, 2 * n),
            numbers("I", u32, COUNTS * n),
            numbers("q", instants, n),
        )
    ),
    st.builds(Report, words, instants, st.text(st.characters(codec="utf-8"), max_size=50)),
)


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
    ],
)
def test_a_reading_that_is_no_number_is_malformed(reading: Message) -> None:
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
