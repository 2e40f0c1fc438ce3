"""Each field of a message at its bounds: the last value is read as it was written, and the first beyond is refused."""

import math
from typing import Any

import pytest

from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.orders import MOST_M, Order, OrderKind
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, STILL, Enu
from fanet_mw.wire import frame, links, loads, places, rounds, schedule, search_messages
from fanet_mw.wire.schedule import Join, Member, Schedule
from fanet_mw.wire.search_messages import Bid, Roll, ToldOrder, encode_bids, told_in
from fanet_mw.wire.search_plan import MOST_PLACES, Search, SearchStatus
from fanet_mw.wire.survivors import MOST_DBM, MOST_SURVIVORS, Found, Standing, Survivor, person_id

AHEAD = bytes(frame.HEADER_BYTES)
NOBODY = frame.ANY_NODE
HERE = Enu(1.0, 2.0, 3.0)
FAR = FARTHEST_M + 1.0

STATUS = SearchStatus(5, HERE, 9, 3, 50)
REPORT = Survivor(5, 7, 9, HERE, -70.0)
FIND = Found(5, 7, 10.0, 20.0, 4.0, 0.0, 9.0, 9, Standing.CONFIRMED)
PERSON = FIND._replace(survivor=person_id(3, 2))
JOIN = Join(9, HERE)
ROLL = Roll(100, 9, 3, (1,) * MOST_PLACES, frozenset({2}))
ORDER = ToldOrder(5, 9, 1, Order(OrderKind.SEARCH, 4, 10.0, 20.0, 30.0))
LINES = Search(5, 100.0, -0.0, 300.0, 50.0, 10.0, 0, 1, 9, (1, 2, 3, 4, 0, 6), 2, 1, 1)
SPIRAL = Search(5, 100.0, 20.0, 300.0, 50.0, 10.0, 0, 1, 9, (1, 2, 3), 1, 0, 1, shape=1, teams=2)
RING = SPIRAL._replace(shape=3)
FAN = SPIRAL._replace(shape=5, first_m=-100.0, last_m=40.0)
SCHEDULE = Schedule(5, 300, 100, 7, 9, 3, 0, 2, (Member(4, 2, is_head=False), Member(5, 1, is_head=True)))


def of_order(**fields: Any) -> ToldOrder:
    return ORDER._replace(order=ORDER.order._replace(**fields))


def bounds(message: Any, name: str, *values: tuple[Any, Any]) -> list[tuple[Any, Any]]:
    """Pairs of messages: the last value of a field that holds, and the first that does not."""
    return [(message._replace(**{name: held}), message._replace(**{name: refused})) for held, refused in values]


IDS = ((1, 0), (NOBODY - 1, NOBODY))
INSTANT = (frame.LATEST_US, frame.LATEST_US + 1)
PLACES = [
    pair
    for axis in ("east", "north", "up")
    for sign in (-1, 1)
    for pair in [(HERE._replace(**{axis: sign * FARTHEST_M}), HERE._replace(**{axis: sign * FAR}))]
] + [(HERE, HERE._replace(east=math.nan)), (HERE, HERE._replace(up=math.inf))]
SPEEDS = [
    (STILL._replace(**{axis: sign * FASTEST_M_S}), STILL._replace(**{axis: sign * (FASTEST_M_S + 1)}))
    for axis in ("east", "north", "up")
    for sign in (-1, 1)
]
PAIRS = [
    *bounds(STATUS, "node", *IDS), *bounds(STATUS, "t_us", INSTANT), *bounds(STATUS, "charge", (0, 101), (100, 101)),
    *bounds(STATUS, "absent", (True, 2)), *bounds(STATUS, "position", *PLACES),
    *bounds(REPORT, "reporter", *IDS), *bounds(REPORT, "t_us", INSTANT), *bounds(REPORT, "position", *PLACES),
    *bounds(REPORT, "survivor", (1, 0), (MOST_SURVIVORS, MOST_SURVIVORS + 1)),
    *bounds(REPORT, "rssi_dbm", (MOST_DBM, MOST_DBM + 1), (-MOST_DBM, -MOST_DBM - 1), (0.0, math.nan)),
    *bounds(FIND, "node", *IDS), *bounds(FIND, "t_us", INSTANT), *bounds(FIND, "standing", (Standing.AMONG, 5)),
    *bounds(FIND, "survivor", (1, 0), (MOST_SURVIVORS, MOST_SURVIVORS + 1)),
    *[pair for axis in ("east_m", "north_m") for sign in (-1, 1)
      for pair in bounds(FIND, axis, (sign * FARTHEST_M, sign * FAR))],
    *[pair for axis in ("east", "north")
      for pair in bounds(FIND._replace(covariance_m2=0.0), f"{axis}_variance_m2", (0.0, -0.01), (1e10, 1.1e10))],
    *bounds(FIND, "covariance_m2", (6.0, 6.01), (-6.0, -6.01), (0.0, math.nan)),
    *bounds(PERSON, "survivor", (person_id(1, 0), person_id(1, 0) - 1)),
    *bounds(PERSON, "survivor", (person_id(NOBODY, 0) - 1, person_id(NOBODY, 0))),
    *bounds(PERSON, "standing", (Standing.REFUTED, Standing.INSIDE), (Standing.CONFIRMED, Standing.ESTIMATED)),
    *bounds(JOIN, "node", *IDS), *bounds(JOIN, "instead_of", (0, NOBODY), (NOBODY - 1, NOBODY)),
    *bounds(JOIN, "position", *PLACES), *bounds(JOIN, "velocity", *SPEEDS),
    *bounds(ROLL, "planner", *IDS), *bounds(ROLL, "revision", (1, 0)),
    *bounds(ORDER, "post", *IDS), *bounds(ORDER, "t_us", INSTANT), *bounds(ORDER, "serial", (1, 0)),
    (of_order(node=NOBODY - 1), of_order(node=NOBODY)), (of_order(node=1), of_order(node=0)),
    (of_order(radius_m=0.5), of_order(radius_m=0.0)), (of_order(radius_m=MOST_M), of_order(radius_m=MOST_M + 1)),
    (of_order(kind=OrderKind.RELEASE, node=0), of_order(kind=OrderKind.STAY, node=0)),
    (of_order(kind=OrderKind.NO_FLY, node=0), of_order(kind=OrderKind.NO_FLY)),
    (of_order(kind=OrderKind.END, node=0), of_order(kind=OrderKind.END)),
    (of_order(kind=OrderKind.STAY, radius_m=0.0), of_order(kind=OrderKind.NO_FLY, node=0, radius_m=0.0)),
    *[(of_order(**{axis: sign * MOST_M}), of_order(**{axis: sign * (MOST_M + 1)}))
      for axis in ("east_m", "north_m") for sign in (-1, 1)],
    *bounds(LINES, "planner", *IDS), *bounds(LINES, "start_us", INSTANT), *bounds(LINES, "revision", (1, 0)),
    *bounds(LINES, "nodes", ((1, 2, 3, 4, 5, 0), (1, 2, 3, 4, 1, 6)), ((0, 0, 0, 0, 0, 0), (1, 2, 3, 3, 0, 6))),
    *[pair for plan in (LINES, SPIRAL, RING, FAN) for pair in (
        *bounds(plan, "narrower_m", (0.0, -0.01), (100.0, 100.01)), *bounds(plan, "height_m", (0.0, -0.01)),
        *bounds(plan, "height_m", (FARTHEST_M, FAR)), *bounds(plan, "speed_m_s", (0.125, 0.09), (1000.0, 1000.1)),
    )],
    *bounds(LINES, "first_m", (0.0, -0.01), (299.0, 299.1)), *bounds(LINES, "last_m", (1.0, 0.9), (FARTHEST_M, FAR)),
    *bounds(LINES, "half_width_m", (0.0, -0.01), (FARTHEST_M, FAR)),
    *bounds(RING, "first_m", (1.0, 0.9), (299.0, 299.1)), *bounds(RING, "half_width_m", (1.0, 0.9)),
    *bounds(SPIRAL, "first_m", (1.0, 0.9), (300.0, 300.1)), *bounds(SPIRAL, "half_width_m", (1.0, 0.9)),
    *bounds(FAN, "first_m", (100.0, 99.9), (-100.0, -99.9), (-FARTHEST_M, -FAR)),
    *bounds(FAN._replace(first_m=0.0), "last_m", (100.0, 99.9), (-100.0, -99.9), (FARTHEST_M, FAR)),
    *bounds(FAN._replace(half_width_m=1.0), "half_width_m", (1.0, 0.9)),
    *bounds(SPIRAL, "shape", (1, 6), (4, 6)), *bounds(SPIRAL, "relays", (0, 1)),
    (SPIRAL._replace(teams=1, nodes=(1, 2)), SPIRAL._replace(teams=0, nodes=(1,))),
    (SPIRAL, SPIRAL._replace(lanes=0, nodes=(1,))),
    (LINES._replace(teams=4, nodes=(0,) * 10), LINES._replace(teams=3, nodes=(0,) * 8)),
    (LINES, LINES._replace(lanes=1, nodes=(0,) * 4)), (LINES, LINES._replace(teams=0, nodes=(0,) * 2)),
    (LINES._replace(lanes=98, followers=3, nodes=(0,) * 200), LINES._replace(lanes=100, nodes=(0,) * 200)),
    *bounds(SCHEDULE, "leader", *IDS), *bounds(SCHEDULE, "start_us", INSTANT),
    *bounds(SCHEDULE, "period_us", (300, 299)),
    *bounds(SCHEDULE, "slot_us", (100, 101), (1, 0)), *bounds(SCHEDULE, "clusters", (3, 0), (3, 2)),
    *bounds(SCHEDULE, "part", (1, 2)), *bounds(SCHEDULE, "parts", (1, 0)), *bounds(SCHEDULE, "epoch", (1, 0)),
    *bounds(SCHEDULE, "members", *[tuple((Member(node, 2, is_head=True),) for node in pair) for pair in IDS]),
    *bounds(SCHEDULE, "members", (SCHEDULE.members, SCHEDULE.members + SCHEDULE.members[:1])),
    (SCHEDULE._replace(epoch=0, members=()), SCHEDULE._replace(members=())),
]  # fmt: skip


def read_as(kind: Any, packed: bytes) -> Any:
    """The only message of a frame; of a search there may be several kinds in one frame."""
    return kind.decode_frame(packed) if hasattr(kind, "decode_frame") else told_in(packed)[0]


def read(message: Any) -> Any:
    return read_as(type(message), AHEAD + message.encode_frame(4))


@pytest.mark.parametrize(("held", "refused"), PAIRS, ids=[str(at) for at in range(len(PAIRS))])
def test_a_field_is_read_up_to_its_bound_and_refused_beyond(held: Any, refused: Any) -> None:
    assert read(held) == held
    with pytest.raises(MalformedFrameError):
        read(refused)


@pytest.mark.parametrize(
    ("spec", "message"),
    [(frame.STATUS, STATUS), (frame.SURVIVOR, REPORT), (frame.FOUND, FIND), (frame.JOIN, JOIN), (frame.ROLL, ROLL),
     (frame.ORDER, ORDER), (frame.SEARCH, LINES), (frame.SCHEDULE, SCHEDULE)],
    ids=lambda part: type(part).__name__,
)  # fmt: skip
def test_a_message_of_another_version_is_refused(spec: frame.Spec, message: Any) -> None:
    fields = frame.decode_first(spec, AHEAD + message.encode_frame(4))
    at = 15 if spec is frame.SEARCH else 3 if spec is frame.ROLL else len(fields) - 1
    assert fields[at] == frame.VERSION
    for other in (frame.VERSION - 1, frame.VERSION + 1):
        payload = spec.layout.pack(*fields[:at], other, *fields[at + 1 :])
        with pytest.raises(MalformedFrameError):
            read_as(type(message), AHEAD + frame.encode_inner(spec, payload, node=4))


def test_a_plan_and_a_roll_are_as_long_as_their_places_up_to_200() -> None:
    for count in (45, 200):
        nodes = tuple(range(1, count + 1))
        plan = LINES._replace(lanes=20, relays=count - 40, followers=0, nodes=nodes)
        assert read(plan) == plan
        assert len(plan.encode_frame(4)) == frame.OVERHEAD + 44 + count
        roll = ROLL._replace(ages=(1,) * count)
        assert read(roll).ages[:count] == roll.ages
        assert len(roll.encode_frame(4)) == frame.OVERHEAD + 9 + count


def test_zeros_that_a_sender_leaves_out_at_the_end_are_filled_in() -> None:
    plan = LINES._replace(nodes=(1, 2, 3, 0, 0, 0))
    whole = told_in(AHEAD + plan.encode_frame(4))
    packed = frame.SEARCH.layout.pack(*frame.decode_first(frame.SEARCH, AHEAD + plan.encode_frame(4)))
    assert told_in(AHEAD + frame.encode_inner(frame.SEARCH, packed, node=4)) == whole == (plan,)
    too_long = AHEAD + frame.encode_inner(frame.SEARCH, packed + b"\0", node=4)
    assert told_in(too_long) == ()
    with pytest.raises(MalformedFrameError):
        frame.decode_first(frame.SEARCH, too_long)


def test_a_plan_of_a_uav_that_one_byte_cannot_name_is_not_written() -> None:
    assert read(LINES._replace(nodes=(1, 2, 3, 255, 0, 0))).nodes[3] == 255
    with pytest.raises(LocalProtocolError, match="256"):
        LINES._replace(nodes=(1, 2, 3, 256, 0, 0)).encode_frame(4)


def test_bids_are_of_nodes_for_survivors_and_as_many_as_one_message_holds() -> None:
    def read_bids(*given: Bid) -> Any:
        return told_in(AHEAD + encode_bids(given, node=4))

    bid = Bid(7, 9, 100, 3, 2)
    for field, held, refused in (
        ("survivor", 1, 0), ("survivor", MOST_SURVIVORS, MOST_SURVIVORS + 1), ("bidder", 1, 0),
        ("bidder", NOBODY - 1, NOBODY),
    ):  # fmt: skip
        kept = bid._replace(**{field: held})
        assert read_bids(bid, kept) == (search_messages.Bids((bid, kept)),)
        with pytest.raises(MalformedFrameError):
            read_bids(bid, bid._replace(**{field: refused}))
    full = tuple(Bid(1 + at, 2 + at, 3 + at, 4 + at, 5 + at) for at in range(search_messages.MOST_BIDS))
    assert read_bids(*full) == (search_messages.Bids(full),)
    assert read_bids() == (search_messages.Bids(()),)
    with pytest.raises(LocalProtocolError):
        encode_bids((*full, bid), node=4)


def test_a_roll_tells_ages_up_to_long_ago_and_no_more_places_than_a_plan_has() -> None:
    told = ROLL._replace(ages=(0, 126, 127, 128, 4000), lost=frozenset({0, 3}))
    got = read(told)
    assert got.ages[:5] == (0, 126, 127, 127, 127)
    assert got.lost == told.lost
    with pytest.raises(LocalProtocolError):
        ROLL._replace(ages=(1,) * (MOST_PLACES + 1)).encode_frame(4)


def test_a_plan_and_a_schedule_of_more_than_fits_are_not_written() -> None:
    with pytest.raises(LocalProtocolError):
        LINES._replace(nodes=(0,) * (MOST_PLACES + 1)).encode_frame(4)
    full = SCHEDULE._replace(members=tuple(Member(node, 0, is_head=False) for node in range(1, schedule.CAPACITY + 1)))
    assert read(full) == full
    with pytest.raises(LocalProtocolError):
        full._replace(members=(*full.members, Member(99, 0, is_head=False))).encode_frame(4)
    most = SCHEDULE._replace(clusters=0x8000, slot_us=1, period_us=0x8000)
    assert read(most) == most
    with pytest.raises(LocalProtocolError):
        most._replace(clusters=0x8001).encode_frame(4)


def test_loads_are_bounded_but_for_the_expected_one_and_never_divide_by_zero() -> None:
    def read_loads(*members: int) -> tuple[int, ...]:
        return loads.Loads.decode_frames(AHEAD + loads.Loads(members).encode_frames(4)).members

    full = (loads.MOST_LOAD, loads.AS_EXPECTED, 0, *range(loads.CAPACITY - 3))
    assert read_loads(*full) == full
    for wrong in (loads.MOST_LOAD + 1, loads.AS_EXPECTED - 1):
        with pytest.raises(MalformedFrameError):
            read_loads(1, wrong)
    twice = loads.Loads((1,)).encode_frames(4) * 2
    for content in (b"", twice):
        with pytest.raises(MalformedFrameError):
            loads.Loads.decode_frames(AHEAD + content)
    intervals = [loads.interval_ns_of(load, expected_ns=77) for load in (0, 1, 4, loads.AS_EXPECTED)]
    assert intervals == [loads.PER_NS, loads.PER_NS, loads.PER_NS // 4, 77]


def test_places_arrive_in_whole_metres_in_two_messages_and_in_order() -> None:
    members = tuple(Enu(at + 0.4, -at - 0.4, 40000.0 if at == 1 else -40000.0) for at in range(places.CAPACITY + 1))
    told = places.Places(members, Enu(0.6, -0.6, 50.0))
    packed = AHEAD + told.encode_frames(4)
    got = places.Places.decode_frames(packed)
    assert got.leader == Enu(1.0, -1.0, 50.0)
    assert got.members == tuple(Enu(at, -at, 32767.0 if at == 1 else -32767.0) for at in range(places.CAPACITY + 1))
    size = len(places.Places(members[: places.CAPACITY], told.leader).encode_frames(4))
    content = packed[len(AHEAD) :]
    for wrong in (content[size:] + content[:size], content[:size] * 2, b""):
        with pytest.raises(MalformedFrameError):
            places.Places.decode_frames(AHEAD + wrong)


def test_links_have_two_ends_and_one_sender_and_as_many_as_four_messages_hold() -> None:
    def read_links(told: links.Links) -> links.Links | None:
        return links.Links.decode_frames(AHEAD + told.encode_frames())

    link = links.Link(1, NOBODY - 1, 200, -128)  # type: ignore[arg-type]
    told = links.Links(9, (link,), 3, 4, 1, 2)
    assert read_links(told) == told
    assert read_links(told._replace(links=())) == told._replace(links=())
    most = told._replace(links=(link,) * (links.CAPACITY * links.MESSAGES))
    assert read_links(most) == most
    assert links.Links.decode_frames(AHEAD) is None
    wrong_ends = ({"a": 0}, {"a": NOBODY}, {"b": 0}, {"b": NOBODY}, {"b": 1})
    for wrong in (
        most._replace(links=(*most.links, link)), told._replace(part=2), told._replace(node=0),
        told._replace(node=NOBODY), *(told._replace(links=(link._replace(**ends),)) for ends in wrong_ends),
    ):  # fmt: skip
        with pytest.raises(MalformedFrameError):
            read_links(wrong)
    two = told.encode_frames() + told._replace(epoch=5).encode_frames()
    with pytest.raises(MalformedFrameError):
        links.Links.decode_frames(AHEAD + two)
    assert [len(part) for part in links.frames_of(most.links + most.links[:5])] == [144, 5]


def test_a_grade_is_25_steps_per_factor_e_of_loss_up_to_230_and_a_power_a_signed_byte() -> None:
    assert [links.grade_of(1 - math.exp(-nepers)) for nepers in (0, 1, 4, 9)] == [0, 25, 100, 225]
    assert links.grade_of(1.0) == 230
    assert links.Link(1, 2, 50, 0).chance == pytest.approx(1 - math.exp(-2))  # type: ignore[arg-type]
    assert [links.power_of(dbm) for dbm in (-500.0, -77.6, 126.6, 500.0)] == [-128, -78, 127, 127]


@pytest.mark.parametrize("count", [1, 8, 9, 60, rounds.MOST_NODES])
def test_whom_nodes_hear_is_told_in_as_many_bytes_as_the_swarm_needs(count: int) -> None:
    entries = [rounds.HeardNodes(1 + at % count, at, (1 << count) - 1 - at % 2, often=at % 3 == 0) for at in range(21)]
    packed = AHEAD + rounds.encode_heard(entries, 4, count=count)
    assert rounds.decode_heard(packed) == entries
    messages = -(-len(entries) // (64 // (3 + -(-count // 8))))
    assert len(packed) - len(AHEAD) == messages * rounds.HEARD_BYTES
    assert rounds.encode_heard([], 4, count=count) == b""


def test_a_node_that_hears_is_one_that_can_exist() -> None:
    for node, held in ((0, False), (1, True), (rounds.MOST_NODES, True), (rounds.MOST_NODES + 1, False)):
        packed = AHEAD + rounds.encode_heard([rounds.HeardNodes(node, 0, 1)], 4, count=8)
        if held:
            assert rounds.decode_heard(packed)[0].node == node
        else:
            with pytest.raises(MalformedFrameError):
                rounds.decode_heard(packed)
    for count, length in ((17, 4), (1, 3), (2, 33)):
        payload = bytes(64) + bytes((count, length, frame.VERSION))
        with pytest.raises(MalformedFrameError):
            rounds.decode_heard(AHEAD + frame.encode_inner(frame.HEARD, payload, node=4))


def test_held_packets_come_back_in_order_over_several_messages() -> None:
    held = [rounds.HeldPacket(1000 + at, 1 + at) for at in range(rounds.CAPACITY + 1)]
    packed = AHEAD + rounds.encode_held(held, 4)
    assert rounds.decode_held(packed) == held
    assert len(packed) - len(AHEAD) == 2 * rounds.HELD_BYTES
    assert rounds.decode_held(AHEAD + rounds.encode_held([], 4)) == []


def test_the_deviation_of_a_find_is_that_of_its_worst_direction() -> None:
    assert FIND.sigma_m == 3.0
    assert FIND._replace(east_variance_m2=5.0, north_variance_m2=5.0, covariance_m2=-4.0).sigma_m == 3.0
    assert FIND._replace(east_variance_m2=0.0, north_variance_m2=0.0).sigma_m == 0.0


LISTS = [
    (frame.LOADS, loads.Loads.decode_frames, loads.Loads((1, 2)).encode_frames(4), loads.CAPACITY),
    (frame.HELD, rounds.decode_held, rounds.encode_held([rounds.HeldPacket(1, 2)], 4), rounds.CAPACITY),
    (frame.PLACES, places.Places.decode_frames, places.Places((HERE,), HERE).encode_frames(4), places.CAPACITY),
    (frame.LINKS, links.Links.decode_frames, links.Links(9, ()).encode_frames(), links.CAPACITY),
]


@pytest.mark.parametrize(("spec", "decode", "written", "capacity"), LISTS, ids=["loads", "held", "places", "links"])
def test_a_list_has_the_version_and_no_more_entries_than_fit(
    spec: frame.Spec, decode: Any, written: bytes, capacity: int
) -> None:
    *fields, count, version = frame.decode_first(spec, AHEAD + written)
    assert decode(AHEAD + written)
    for wrong in ((count, version + 1), (count, version - 1), (capacity + 1, version)):
        with pytest.raises(MalformedFrameError):
            decode(AHEAD + frame.encode_inner(spec, spec.layout.pack(*fields, *wrong), node=4))


def test_the_first_node_may_tell_links() -> None:
    told = links.Links(1, ())
    assert links.Links.decode_frames(AHEAD + told.encode_frames()) == told
