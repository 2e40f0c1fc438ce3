"""How much nodes send is learnt from the numbers and births of their packets, and decides how many turns they get."""

import math
import random
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.clustered.links.heard_load import HeardLoads, stated_loads
from fanet_mw.routing.clustered.timetable.node_timetable import NO_LOADS, FittedTimetable
from fanet_mw.routing.clustered.timetable.turn_allocation import fit
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.loads import AS_EXPECTED, MOST_LOAD, PER_NS, Loads, interval_ns_of

MakeScenario = Callable[..., Scenario]
NODE = NodeId(7)


def heard_of(births_s: list[float], *, every: int = 1) -> HeardLoads:
    """What a node knows that has received each packet, or one in `every`, half a second after its birth."""
    heard = HeardLoads(interval_s=1.0, stated={})
    for seq, born_s in enumerate(births_s):
        if seq % every == 0:
            born_ns = round(born_s * S)
            heard.on_packet(NODE, seq, born_ns=born_ns, now_ns=born_ns + S // 2)
    return heard


def packed(loads: Loads, *, times: int = 1) -> Loads:
    """Loads as they are decoded behind a header."""
    return Loads.decode_frames(bytes(HEADER_BYTES) + times * loads.encode_frames(3))


# --- the estimate ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("interval_s", "load"), [(0.25, 400), (1.0, 100), (3.0, 34), (20.0, 5)])
def test_the_load_of_regular_packets_is_what_they_are(interval_s: float, load: int) -> None:
    births_s = [interval_s * index for index in range(120)]
    assert heard_of(births_s).load(NODE, now_ns=round(births_s[-1] * S) + S) == load


def test_packets_that_got_lost_or_found_no_turn_are_counted_all_the_same() -> None:
    births_s = [0.25 * index for index in range(120)]
    assert heard_of(births_s, every=7).load(NODE, now_ns=31 * S) == 400


def test_random_arrivals_get_more_than_their_mean() -> None:
    loads = []
    for seed in range(40):
        drawn = random.Random(seed)
        births_s = [0.0]
        while births_s[-1] < 60:
            births_s.append(births_s[-1] + drawn.expovariate(2.0))
        loads.append(heard_of(births_s).load(NODE, now_ns=60 * S))
    assert sum(load >= 200 for load in loads) > 34
    assert sum(loads) / len(loads) < 400


def test_who_was_hardly_heard_is_taken_to_send_as_expected() -> None:
    assert heard_of([0, 1, 2]).load(NODE, now_ns=4 * S) == AS_EXPECTED
    assert heard_of([]).load(NODE, now_ns=4 * S) == AS_EXPECTED


def test_the_load_of_a_node_that_falls_silent_goes_down() -> None:
    heard = heard_of([0.25 * index for index in range(80)])
    assert heard.load(NODE, now_ns=28 * S) == 400
    assert heard.load(NODE, now_ns=35 * S) < 200
    assert heard.load(NODE, now_ns=200 * S) < 30


def test_packets_that_waited_long_for_a_turn_are_no_silence() -> None:
    """Five a second are sent, two a second have turns: each is heard later than the one before."""
    heard = HeardLoads(interval_s=1.0, stated={})
    for seq in range(80):
        heard.on_packet(NODE, seq, born_ns=seq * S // 5, now_ns=seq * S // 2)
    assert heard.load(NODE, now_ns=41 * S) == 500


def test_what_a_packet_cannot_truly_state_is_refused_and_counted() -> None:
    heard = heard_of([float(index) for index in range(10)])
    heard.on_packet(NODE, 10, born_ns=60 * S, now_ns=10 * S)
    assert heard.refused == 1, "born in the future"
    heard.on_packet(NODE, 8 + 4 * 201, born_ns=12 * S, now_ns=12 * S)
    assert heard.refused == 2, "201 packets a second"
    for seq in range(14, 24):
        heard.on_packet(NODE, seq, born_ns=seq * S, now_ns=seq * S)
    assert heard.refused == 3, "the next true packet seems to go back"
    assert heard.load(NODE, now_ns=24 * S) == 100


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 2**62), st.integers(0, 2**62)), max_size=30))
def test_any_packets_give_a_load_that_can_be_announced(said: list[tuple[int, int, int]]) -> None:
    heard = HeardLoads(interval_s=1.0, stated={})
    for seq, born_ns, now_ns in said:
        heard.on_packet(NODE, seq, born_ns=born_ns, now_ns=now_ns)
    load = heard.load(NODE, now_ns=2**62)
    assert 1 <= load <= MOST_LOAD or load == AS_EXPECTED
    assert packed(Loads((load,))) == Loads((load,))


# --- on the air -----------------------------------------------------------------------------------------------------


@given(st.lists(st.one_of(st.integers(0, MOST_LOAD), st.just(AS_EXPECTED)), max_size=56))
def test_loads_come_back_as_they_were(loads: list[int]) -> None:
    assert packed(Loads(tuple(loads))) == Loads(tuple(loads))


def test_a_load_beyond_the_greatest_is_malformed() -> None:
    with pytest.raises(MalformedFrameError, match="20001 packets in 100 s must be <= 20000"):
        packed(Loads((100, MOST_LOAD + 1)))
    with pytest.raises(MalformedFrameError, match="2 messages of loads"):
        packed(Loads((100,)), times=2)


# --- when a timetable is replaced -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("before", "now", "replaced"),
    [
        ({}, {}, False),
        ({1: AS_EXPECTED, 2: AS_EXPECTED}, {1: 100, 2: 100}, False),
        ({1: 100, 2: 100}, {1: 100, 2: 180}, False),
        ({1: 100, 2: 100}, {1: 100, 2: 220}, True),
        ({1: 199, 2: 100}, {1: 203, 2: 100}, False),
        ({1: 800, 2: 100}, {1: 100, 2: 100}, True),
        ({1: 100, 2: 100, 3: 100, 4: 300}, {1: 100, 2: 100, 3: 100, 4: 100}, False),
    ],
)
def test_a_timetable_is_replaced_when_nodes_need_more_turns_or_far_fewer(
    before: Mapping[NodeId, int], now: Mapping[NodeId, int], replaced: bool
) -> None:
    heard = HeardLoads(interval_s=1.0, stated={})
    assert not heard.worth_a_change(before, now, period_ns=S // 2, now_ns=0), "not at once"
    assert heard.worth_a_change(before, now, period_ns=S // 2, now_ns=3 * S) == replaced
    assert not heard.worth_a_change(before, before, period_ns=S // 2, now_ns=4 * S)
    assert not heard.worth_a_change(before, now, period_ns=S // 2, now_ns=5 * S), "not again at once"


# --- what a timetable makes of loads --------------------------------------------------------------------------------


class Line:
    """Nine nodes in a line, all heads but the leader, with superframes of half a second."""

    def __init__(self, make_scenario: MakeScenario, **keys: Any) -> None:
        common = {"clusters.relay": "scheduled", "nodes.count": 9, "clusters.flooding_period_s": 0.5}
        self.scenario = make_scenario(**common | {"clusters.load": "heard", "traffic.interval_s": 0.5} | keys)

    def fitted(self, loads: Mapping[NodeId, int]) -> FittedTimetable:
        places = tuple((NodeId(node), Enu(150.0 * node, 0, 50)) for node in range(1, 10))
        heads = {node: node for node, _ in places[1:]}
        found = fit(self.scenario, places, heads, leader=NodeId(1), loads=loads)
        assert found is not None
        return found

    def turns(self, loads: Mapping[NodeId, int]) -> Mapping[NodeId, int]:
        """The root turns of each node, in each of the parts of the superframe in which it has them for its load."""
        found = self.fitted(loads).table.roots()
        counts = Counter(turn.root for turn in found)
        parts = math.gcd(*counts.values())
        return {node: count // parts for node, count in counts.items()}


def test_a_node_gets_turns_for_what_it_sends(make_scenario: MakeScenario) -> None:
    line = Line(make_scenario)
    usual, heard = line.turns(NO_LOADS), line.turns({NODE: 1000})
    assert usual[NODE] == usual[NodeId(3)]
    assert heard[NODE] == 4 * heard[NodeId(3)], "eight for two: five packets, and half as many again"


def test_where_turns_are_plenty_nobody_loses_any(make_scenario: MakeScenario) -> None:
    line = Line(make_scenario)
    assert line.turns({NODE: 10}) == line.turns(NO_LOADS)


def test_where_the_air_is_idle_turns_come_more_often_and_each_packet_waits_less(make_scenario: MakeScenario) -> None:
    """In a superframe of one second, of 800 turns, a flood of nine nodes takes some eight."""
    often = {
        period_s: Line(make_scenario, **{"clusters.flooding_period_s": period_s, "traffic.interval_s": 5.0}).fitted(
            NO_LOADS
        )
        for period_s in (0.15, 0.3, 1.0)
    }
    counts = {period_s: len(found.table.offsets_of(NODE)) for period_s, found in often.items()}
    assert counts == {0.15: 1, 0.3: 2, 1.0: 8}
    offsets = often[1.0].table.offsets_of(NODE)
    gaps = {after - before for before, after in pairwise(offsets)}
    assert len(gaps) == 1, "evenly spread"
    used = {turn.offset % often[1.0].turns.per_superframe for turn in often[1.0].table.turns}
    assert len(often[1.0].table.spare[NODE]) > 0.1 * len(used), "half of the air is left for others"


def test_whose_traffic_is_stated_to_be_none_has_one_turn(make_scenario: MakeScenario) -> None:
    line = Line(make_scenario, **{"traffic.interval_s": 0.05, "traffic.sources": (NODE,)})
    usual, heard = line.turns(NO_LOADS), line.turns({NodeId(4): 800})
    assert usual[NODE] == heard[NODE] == 11, "ten packets in a superframe, and one turn more"
    assert all(usual[node] == 1 for node in usual if node != NODE)
    assert heard[NodeId(4)] == 7, "four packets, and half as many again"


def test_only_nodes_that_no_class_names_have_no_traffic(make_scenario: MakeScenario) -> None:
    named = make_scenario(**{"nodes.count": 4, "traffic.sources": (2,)})
    more = named.traffic.model_copy(update={"sources": (3,)})
    drawn, none = (more.model_copy(update=keys) for keys in ({"sources": 1}, {"sources": 1, "arrivals": "none"}))
    silent = {
        sources: list(stated_loads(named.model_copy(update={"further_traffic": classes})))
        for sources, classes in {"one": (), "two": (more,), "any": (more, drawn), "no more": (none,)}.items()
    }
    assert silent == {"one": [1, 3, 4], "two": [1, 4], "any": [], "no more": [1, 3, 4]}


def test_turns_that_others_do_not_need_make_room(make_scenario: MakeScenario) -> None:
    """Where two packets of each node had to share a turn, one has it to itself, and turns are shorter."""
    line = Line(make_scenario, **{"traffic.interval_s": 0.0125, "traffic.payload_bytes": 400})
    usual, heard = line.fitted(NO_LOADS), line.fitted({NodeId(node): 200 for node in range(2, 10)})
    assert heard.together < usual.together
    assert heard.turns.turn_ns < usual.turns.turn_ns
    assert heard.enough


def test_who_sends_far_too_much_takes_nothing_from_the_others(make_scenario: MakeScenario) -> None:
    line = Line(make_scenario)
    loads = {NodeId(node): 1200 for node in range(2, 10)}
    found, greedy = line.fitted(loads), line.fitted(loads | {NODE: MOST_LOAD})
    had, has = (Counter(turn.root for turn in fitted.table.roots()) for fitted in (found, greedy))
    assert not greedy.enough
    assert all(has[node] * greedy.together >= 6 for node in loads), "as many as their loads need"
    assert has[NODE] > had[NODE]


def test_a_forged_load_of_nothing_has_an_interval_too() -> None:
    assert [interval_ns_of(load, expected_ns=7) for load in (0, 1, 4, AS_EXPECTED)] == [PER_NS, PER_NS, PER_NS // 4, 7]
