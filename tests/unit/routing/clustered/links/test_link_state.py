"""Measured links: as they are told, as hellos show them, as the leader puts them together, and what is made of them."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.mavlink import Encoder
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.links.link_quality import (
    FAST,
    FIRST,
    WINDOW,
    LinkQuality,
    LinkState,
    adjacency,
    worth_a_change,
)
from fanet_mw.routing.clustered.timetable.delivery_odds import odds
from fanet_mw.routing.clustered.timetable.interference import Geometry, InterferenceByPower
from fanet_mw.routing.clustered.timetable.redundant_scheduling import Wave, enough_for
from fanet_mw.routing.clustered.timetable.timetable import Timetable, redundant_timetable
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, HEADER_BYTES, PRIORITY_CONTROL, Header, Kind
from fanet_mw.wire.links import CAPACITY, MESSAGES, Link, Links, frames_of, grade_of, power_of

HEADER = bytes(HEADER_BYTES)
NODES = st.integers(1, 60_000).map(NodeId)
LINK = st.builds(Link, NODES, NODES, st.integers(0, 230), st.integers(-128, 127)).filter(lambda link: link.a != link.b)


# --- as they are told -------------------------------------------------------------------------------------------------


@given(st.lists(LINK, max_size=CAPACITY * MESSAGES), st.integers(0, 2**32 - 1), st.integers(0, 65_535))
def test_links_arrive_as_they_were_told(links: list[Link], term: int, epoch: int) -> None:
    told = Links(7, tuple(links), term, epoch, 1, 3)
    assert Links.decode_frames(HEADER + told.encode_frames()) == told


def test_a_frame_without_links_says_nothing_and_a_link_to_itself_is_malformed() -> None:
    assert Links.decode_frames(HEADER) is None
    itself = HEADER + Links(7, (Link(NodeId(3), NodeId(3), 10, -70),)).encode_frames()
    with pytest.raises(MalformedFrameError):
        Links.decode_frames(itself)
    two = HEADER + Links(7, ()).encode_frames() + Links(8, ()).encode_frames()
    with pytest.raises(MalformedFrameError):
        Links.decode_frames(two)


def test_the_links_of_an_assignment_fill_frames_of_less_than_a_turn() -> None:
    links = tuple(Link(NodeId(1), NodeId(node), 50, -80) for node in range(2, 302))
    frames = frames_of(links)
    assert [len(frame) for frame in frames] == [144, 144, 12]
    assert len(Links(1, frames[0]).encode_frames()) + HEADER_BYTES <= 1024


@given(st.floats(0, 0.9999))
def test_a_grade_keeps_the_share_within_what_its_steps_allow(chance: float) -> None:
    kept = Link(NodeId(1), NodeId(2), grade_of(chance), power_of(-80.4)).chance
    assert math.log(1 - kept) == pytest.approx(math.log(1 - chance), abs=0.021)


# --- as hellos show them ----------------------------------------------------------------------------------------------


def heard(quality: LinkQuality, count: int, *, rssi: list[float], until_ns: int) -> Link | None:
    for hello in range(count):
        quality.on_hello(NodeId(2), rssi_dbm=rssi[hello % len(rssi)], now_ns=until_ns - hello * S // 2)
    found = quality.links(now_ns=until_ns)
    return found[0] if found else None


def test_a_share_is_that_of_the_hellos_that_were_due() -> None:
    quality = LinkQuality(NodeId(1), hello_ns=S)
    link = heard(quality, 12, rssi=[-80.0, -75.0], until_ns=100 * S)
    assert link is not None
    assert link.chance == pytest.approx(12.5 / 25, abs=0.02)
    assert link.power_dbm == round(-77.5)


def test_hellos_come_faster_at_first_and_as_many_more_are_due() -> None:
    quality = LinkQuality(NodeId(1), hello_ns=S)
    assert quality.hello_share(now_ns=FIRST * S - 1) == 1 / FAST
    assert quality.hello_share(now_ns=FIRST * S) == 1.0
    link = heard(quality, 12, rssi=[-80.0, -75.0], until_ns=FIRST * S)
    assert link is not None
    assert link.chance == pytest.approx(12.5 / (FAST * FIRST + 1), abs=0.02)


def test_what_a_steady_link_loses_is_not_its_own_loss_unless_it_loses_most() -> None:
    steady = heard(LinkQuality(NodeId(1), hello_ns=S), 14, rssi=[-80.0, -79.5], until_ns=100 * S)
    weak = heard(LinkQuality(NodeId(1), hello_ns=S), 6, rssi=[-81.5, -81.0], until_ns=100 * S)
    assert steady is not None
    assert weak is not None
    assert steady.chance > 0.99
    assert weak.chance < 0.3


@pytest.mark.parametrize(
    ("count", "spread_db", "chance"), [(12, 1.0, 0.99), (12, 1.1, 12.5 / 25), (11, 1.0, 11.5 / 25), (24, 0.0, 0.99)]
)
def test_a_link_is_steady_up_to_a_decibel_if_half_of_what_was_due_came(
    count: int, spread_db: float, chance: float
) -> None:
    link = heard(LinkQuality(NodeId(1), hello_ns=S), count, rssi=[-80.0, -80.0 + spread_db], until_ns=100 * S)
    assert link is not None
    assert link.chance == pytest.approx(chance, abs=0.03)


def test_a_neighbor_that_fell_silent_is_forgotten_after_the_window() -> None:
    quality = LinkQuality(NodeId(1), hello_ns=S)
    quality.on_hello(NodeId(2), rssi_dbm=-70, now_ns=S)
    assert quality.links(now_ns=(WINDOW + 1) * S)
    assert not quality.links(now_ns=(WINDOW + 1) * S + 1)


def test_links_are_told_when_there_is_an_estimate_and_again_when_one_has_changed() -> None:
    quality = LinkQuality(NodeId(1), hello_ns=S)
    for second in range(30):
        quality.on_hello(NodeId(2), rssi_dbm=-80 + second % 3, now_ns=second * S)
    assert not quality.outdated(now_ns=FIRST * S - 1)
    assert not quality.tell(now_ns=FIRST * S - 1)
    assert quality.outdated(now_ns=30 * S)
    assert quality.tell(now_ns=30 * S)
    assert not quality.outdated(now_ns=31 * S)
    assert quality.outdated(now_ns=45 * S)  # fifteen hellos did not come


def test_a_link_that_is_gone_has_changed() -> None:
    quality = LinkQuality(NodeId(1), hello_ns=S)
    for second in range(WINDOW):
        quality.on_hello(NodeId(2), rssi_dbm=-80, now_ns=second * S)
    (link,) = quality.tell(now_ns=WINDOW * S)
    assert link.chance > 0.95
    assert quality.links(now_ns=2 * WINDOW * S) == ()
    assert quality.outdated(now_ns=2 * WINDOW * S)


# --- as the leader puts them together ---------------------------------------------------------------------------------


def link(a: int, b: int, chance: float, dbm: int = -78) -> Link:
    return Link(NodeId(a), NodeId(b), grade_of(chance), dbm)


def test_a_pair_is_as_good_as_both_ends_say_on_average() -> None:
    state = LinkState()
    state.on_report(NodeId(1), [link(2, 1, 0.9)])
    state.on_report(NodeId(2), [link(1, 2, 0.7)])
    (pair,) = state.between([NodeId(1), NodeId(2)])
    assert (pair.a, pair.b) == (1, 2)
    assert pair.chance == pytest.approx(0.8, abs=0.01)


def test_a_direction_in_which_nothing_is_heard_is_no_link_but_may_disturb() -> None:
    state = LinkState()
    state.on_report(NodeId(1), [link(2, 1, 0.9, -70)])
    state.on_report(NodeId(2), [])
    assert state.between([NodeId(1), NodeId(2)]) == (Link(NodeId(1), NodeId(2), 0, -70),)
    assert adjacency(state.between([NodeId(1), NodeId(2)]), [NodeId(1), NodeId(2)]) == {1: (), 2: ()}


def test_nobody_speaks_for_another_and_a_node_that_has_not_told_is_known_by_its_neighbors() -> None:
    state = LinkState()
    state.on_report(NodeId(1), [link(2, 1, 0.9), link(2, 3, 0.9)])
    assert [(pair.a, pair.b) for pair in state.between([NodeId(1), NodeId(2), NodeId(3)])] == [(1, 2)]
    assert state.known([NodeId(1), NodeId(2)]) == 1


def test_usable_links_are_drawn_to_their_mean_and_others_are_left_alone() -> None:
    state = LinkState()
    state.on_report(NodeId(1), [link(2, 1, 0.9), link(3, 1, 0.7), link(4, 1, 0.1), link(5, 1, 0.995)])
    found = {pair.b: pair.chance for pair in state.between([NodeId(node) for node in range(1, 6)])}
    assert found[2] == pytest.approx(0.8 + 0.03, abs=0.01)
    assert found[3] == pytest.approx(0.8 - 0.03, abs=0.01)
    assert found[4] == pytest.approx(0.1, abs=0.02)
    assert found[5] == pytest.approx(0.995, abs=0.002)


def test_a_timetable_is_replaced_when_links_have_changed_much() -> None:
    before = [link(1, n, 0.9) for n in range(2, 12)]
    assert not worth_a_change(before, [link(1, n, 0.85) for n in range(2, 12)])
    assert worth_a_change(before, [link(1, n, 0.75) for n in range(2, 12)])
    assert worth_a_change(before, before[:8])
    assert worth_a_change([], before)


# --- what is made of them ---------------------------------------------------------------------------------------------

GRID = tuple(
    (NodeId(5 * row + column + 1), Enu(200.0 * column, 200.0 * row, 0.0)) for row in range(3) for column in range(5)
)
GEOMETRY = Geometry(250, 500, 200, 2)
CHANCES = st.sampled_from([0.55, 0.7, 0.85, 0.95, 0.995])


@st.composite
def measured(draw: st.DrawFn) -> tuple[Link, ...]:
    """The sides of the grid, each of some quality."""
    pairs = [(a, b) for a, here in GRID for b, there in GRID if a < b and here.minus(there).norm() <= 200]
    return tuple(Link(a, b, grade_of(draw(CHANCES)), draw(st.integers(-82, -76))) for a, b in pairs)


def planned(links: tuple[Link, ...], *, epsilon: float = 0.05) -> Timetable | None:
    roots = tuple(node for node, _ in GRID)
    found = redundant_timetable(GRID, links, roots, GEOMETRY, calls=2, epsilon=epsilon, margin_db=3)
    return None if found is None else found[0]


@examples(12)
@given(measured())
def test_every_node_gets_its_dose_from_holders_undisturbed(links: tuple[Link, ...]) -> None:
    table = planned(links)
    if table is None:
        return
    network = InterferenceByPower(GRID, GEOMETRY, links, margin_db=3)
    sending: dict[int, set[int]] = {}
    for turn in table.turns:
        sending.setdefault(turn.offset % GEOMETRY.turns, set()).add(network.nodes.row[turn.node])
    for node, offsets in table.calls.items():
        assert len(set(offsets)) == 2
        for offset in offsets:
            here = sending.setdefault(offset % GEOMETRY.turns, set())
            assert network.nodes.row[node] not in here
            here.add(network.nodes.row[node])
    enough = enough_for(0.05)
    for root, _ in GRID:
        ready = {network.nodes.row[root]: 0}
        dose: dict[int, int] = {}
        for turn in sorted(turn for turn in table.turns if turn.root == root):
            row, others = network.nodes.row[turn.node], sending[turn.offset % GEOMETRY.turns]
            assert row in ready
            assert ready[row] <= turn.offset
            for other in range(len(GRID)):
                clear = (
                    other not in others and not any(network.disturbing(row, other) >> o & 1 for o in others - {row})
                    if (row, other) in network.dose
                    else False
                )
                if clear:
                    dose[other] = dose.get(other, 0) + network.dose[row, other]
                    if dose[other] >= enough:
                        ready.setdefault(other, turn.offset + GEOMETRY.hop_turns)
        assert len(ready) == len(GRID)


@examples(12)
@st.composite
def any_network(draw: st.DrawFn) -> tuple[int, tuple[Link, ...], int]:
    """A few nodes, links of any quality between any of them, and so many turns."""
    count = draw(st.integers(3, 5))
    pairs = [(a, b) for a in range(1, count + 1) for b in range(a + 1, count + 1) if draw(st.booleans())]
    grades, powers = st.sampled_from([0, 5, 10, 30, 60, 120, 200]), st.sampled_from([-60, -75, -80, -85, -95])
    return (
        count,
        tuple(Link(NodeId(a), NodeId(b), draw(grades), draw(powers)) for a, b in pairs),
        draw(st.integers(5, 40)),
    )


@example(
    (4, tuple(Link(NodeId(a), NodeId(b), grade, power) for a, b, grade, power in [
        (1, 2, 10, -75), (1, 3, 120, -60), (1, 4, 30, -95), (2, 3, 60, -95), (2, 4, 120, -85), (3, 4, 30, -85),
    ]), 15),
)  # fmt: skip
@given(any_network())
def test_any_measured_links_give_a_timetable_or_none(drawn: tuple[int, tuple[Link, ...], int]) -> None:
    """A wave may be over while further frames of it were on offer for the same turn."""
    count, links, turns = drawn
    places = tuple((NodeId(node), Enu(100.0 * node, 0.0, 0.0)) for node in range(1, count + 1))
    roots, geometry = tuple(node for node, _ in places), Geometry(100, 100, turns, 1)
    found = redundant_timetable(places, links, roots, geometry, calls=1, epsilon=0.01, margin_db=3)
    assert found is None or found[0].roots()


@given(measured())
def test_in_a_call_all_neighbors_hear_the_caller(links: tuple[Link, ...]) -> None:
    table = planned(links, epsilon=0.3)
    assert table is not None
    network = InterferenceByPower(GRID, GEOMETRY, links, margin_db=3)
    sending: dict[int, int] = {}
    frames = [(turn.offset, turn.node) for turn in table.turns]
    frames += [(offset, node) for node, offsets in table.calls.items() for offset in offsets]
    for offset, node in frames:
        sending[offset % GEOMETRY.turns] = sending.get(offset % GEOMETRY.turns, 0) | 1 << network.nodes.row[node]
    for node, offsets in table.calls.items():
        row = network.nodes.row[node]
        for offset in offsets:
            others = sending[offset % GEOMETRY.turns] & ~(1 << row)
            for other in (o for s, o in network.dose if s == row):
                assert not others >> other & 1
                assert not network.disturbing(row, other) & others


LINE = tuple((NodeId(node), Enu(200.0 * node, 0.0, 0.0)) for node in range(1, 5))


def test_the_odds_of_a_line_are_those_of_its_hops_and_each_round_of_repair_mends_its_part() -> None:
    links = tuple(Link(NodeId(a), NodeId(a + 1), grade_of(0.8), -79) for a in range(1, 4))
    network = InterferenceByPower(LINE, Geometry(250, 500, 50, 1), links, margin_db=3)
    once = [(0, 0), (1, 1), (2, 2)]
    twice = [(0, 0), (1, 0), (2, 1), (3, 1), (4, 2), (5, 2)]
    first, second = (
        odds(network, [(NodeId(1), sent)] * 40, turns=50, hop_turns=1).missed[NodeId(1)] for sent in (once, twice)
    )
    assert first[0] == pytest.approx(1 - (0.8 + 0.8**2 + 0.8**3) / 3, abs=0.02)
    hop = 1 - 0.2**2
    assert second[0] == pytest.approx(1 - (hop + hop**2 + hop**3) / 3, abs=0.02)
    assert first[1] == pytest.approx(first[0] * (1 - 0.8**2), rel=0.05)


@pytest.mark.parametrize(("off_m", "disturbs"), [(135, True), (137, False), (-135, True), (-137, False)])
def test_who_is_not_heard_disturbs_a_strong_link_from_less_far(off_m: float, disturbs: bool) -> None:
    """17 dB stronger than the weakest with its margin: 10^(17 / 30) times less far than 500 m, that is 135.6 m."""
    at = ((1, 0.0, 0.0), (2, 100.0, 0.0), (3, 100.0, off_m), (4, 9000.0, 0.0), (5, 9200.0, 0.0))
    places = tuple((NodeId(node), Enu(east_m, north_m, 0.0)) for node, east_m, north_m in at)
    links = (Link(NodeId(1), NodeId(2), grade_of(0.99), -59), Link(NodeId(4), NodeId(5), grade_of(0.99), -79))
    network = InterferenceByPower(places, Geometry(250, 500, 50, 1), links, margin_db=3)
    assert network.disturbing(0, 1) == 0b00100 * disturbs
    assert network.disturbing(3, 4) == 0


@pytest.mark.parametrize(("heard_dbm", "disturbs"), [(-69, True), (-70, False)])
def test_who_is_heard_disturbs_what_is_less_than_eleven_db_stronger(heard_dbm: int, disturbs: bool) -> None:
    links = (Link(NodeId(1), NodeId(2), grade_of(0.99), -59), Link(NodeId(2), NodeId(3), grade_of(0.99), heard_dbm))
    network = InterferenceByPower(LINE[:3], Geometry(250, 500, 50, 1), links, margin_db=3)
    assert network.disturbing(0, 1) == 0b100 * disturbs


def test_who_sends_at_the_same_time_is_not_heard_and_who_disturbs_spoils_the_frame() -> None:
    links = tuple(Link(NodeId(a), NodeId(a + 1), grade_of(0.995), -79) for a in range(1, 4))
    network = InterferenceByPower(LINE, Geometry(250, 500, 50, 1), links, margin_db=3)
    flood = (NodeId(1), [(0, 0), (1, 1), (2, 2)])
    clear = odds(network, [flood], turns=50, hop_turns=1).mean
    spoiled = odds(network, [flood, (NodeId(3), [(0, 2)])], turns=50, hop_turns=1).missed[NodeId(1)][0]
    assert clear < 0.05
    assert spoiled > 0.9


def test_whom_nobody_hears_no_round_of_repair_helps() -> None:
    links = (Link(NodeId(1), NodeId(2), grade_of(0.8), -79),)
    network = InterferenceByPower(LINE[:3], Geometry(250, 500, 50, 1), links, margin_db=3)
    missed = odds(network, [(NodeId(1), [(0, 0)])] * 40, turns=50, hop_turns=1).missed[NodeId(1)]
    assert missed[0] == pytest.approx((0.2 + 1) / 2, abs=0.02)
    assert missed[-1] == pytest.approx(1 / 2, abs=0.001), "one of the two others, for ever"


def test_a_wave_repeats_its_frames_over_lossy_links_and_not_over_good_ones() -> None:
    def frames(chance: float) -> int:
        links = tuple(Link(NodeId(a), NodeId(a + 1), grade_of(chance), -79) for a in range(1, 4))
        found = redundant_timetable(
            LINE, links, (NodeId(1),), Geometry(250, 500, 60, 1), calls=1, epsilon=0.05, margin_db=3
        )
        assert found is not None
        return len(found[0].turns)

    assert frames(0.995) == 3
    assert frames(0.8) == 6
    assert frames(0.7) == 9


def test_a_call_is_over_after_one_frame() -> None:
    links = (Link(NodeId(1), NodeId(2), grade_of(0.7), -79),)
    network = InterferenceByPower(LINE[:2], GEOMETRY, links, margin_db=3)
    wave = Wave(network, 0, enough=500, call=True)
    wave.send(3, 0, [1], hop_turns=1)
    assert wave.done


@pytest.mark.parametrize(
    ("origin", "inner", "malformed"),
    [
        (1, Links(1, (Link(NodeId(2), NodeId(3), 10, -70),)).encode_frames(), False),
        (3, Links(1, (Link(NodeId(2), NodeId(3), 10, -70),)).encode_frames(), True),
        (1, Links(1, (Link(NodeId(2), NodeId(9), 10, -70),)).encode_frames(), True),
        (1, Encoder(NodeId(1)).heartbeat(), True),
    ],
    ids=["the leader's", "in another's name", "of a node that is not there", "none"],
)
def test_links_that_are_announced_are_those_of_who_says_so(origin: int, inner: bytes, malformed: bool) -> None:
    scenario = config.build(
        {
            "nodes": {"count": 4}, "clusters": {"relay": "scheduled", "count": 3},
            "radio": {"channel": "log_distance", "fading": "rician"},
            "traffic": {"arrivals": "none"},
        }
    )  # fmt: skip
    node = Node(NodeId(2), scenario, make_protocol, position=Enu(0.0, 0.0, 50.0))
    node.start(0)
    hops = int(origin != 3)
    header = Header(900_000, 5, NodeId(origin), BROADCAST, NodeId(3), Kind.LINKS, 8, hops, PRIORITY_CONTROL, FLAG_FLOOD)
    node.hear(Reception(header.encode() + inner, NodeId(3), S, -60.0), now_ns=S)
    assert node.port.dropped[DropReason.MALFORMED] == malformed
