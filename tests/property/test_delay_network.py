"""Bursts, aggregates and tandems: no simulated trace is ever worse than network calculus says."""

from fractions import Fraction
from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples
from slot_simulator import Slot, delays, earliest_start, network
from tandem_bounds import Flow, Hop, Limited, least_span_ns, ordered_tandem, path_bounds

from fanet_mw.bounds import (
    Bounded,
    Periodic,
    Refused,
    SlotServer,
    Total,
    backlog,
    delay_any_order,
    delay_fifo,
)
from fanet_mw.errors import LocalProtocolError
from fanet_mw.rng import stream


@st.composite
def servers(draw, period: int | None = None):
    airtime = draw(st.integers(1, 8))
    slot = draw(st.integers(airtime, 4 * airtime + 3))
    return SlotServer(airtime, slot, period or draw(st.integers(slot, 3 * slot + 20)))


def periodics(least: int):
    return st.builds(Periodic, st.integers(least, 3 * least), st.integers(0, 4 * least))


def trace(flow: Periodic, rng, *, packets: int = 40) -> list[int]:
    """Packets as bursty as the flow allows in some places: late by all of the jitter, then on time, at random."""
    phase = rng.randrange(flow.interval_ns)
    calm = rng.random()
    late = [flow.jitter_ns if n < packets * calm else 0 for n in range(packets)]
    if rng.random() < 0.5:
        late = [rng.randint(0, flow.jitter_ns) for _ in range(packets)]
    return sorted(phase + n * flow.interval_ns + late[n] for n in range(packets))


def spread(flow: Periodic, packets: int = 12) -> list[int]:
    """The critical trace: everything the jitter can hold back at once, then on time."""
    return [max(0, n * flow.interval_ns - flow.jitter_ns) for n in range(packets)]


@given(periodics(5), st.integers(0, 10**6))
def test_no_trace_is_denser_than_its_spans(flow, seed) -> None:
    at = trace(flow, stream(seed, "trace"))
    spans = list(islice(flow.spans(), len(at)))
    for n, span in enumerate(spans, start=1):
        assert min(at[i + n - 1] - at[i] for i in range(len(at) - n + 1)) >= span


@given(st.lists(periodics(5), min_size=1, max_size=4), servers())
def test_spans_never_fall_and_stay_within_their_token_bucket(flows, server) -> None:
    total = Total(tuple(flows))
    for curve in (total, Limited(total, server, 7)):
        spans = list(islice(curve.spans(), 60))
        assert spans[0] == 0
        assert spans == sorted(spans)
        for n, span in enumerate(spans, start=1):
            assert Fraction(span) >= (n - curve.burst) / curve.rate


@given(servers())
def test_what_is_served_in_a_window_are_the_frames_completed_in_it(server) -> None:
    """In the rest of a period behind the slot, too."""
    completions = [server.completion_ns(n) for n in range(1, 20)]
    for window_ns in range(completions[-1]):
        assert server.served(window_ns) == sum(completion <= window_ns for completion in completions)


@given(st.lists(periodics(5), min_size=1, max_size=3))
def test_spans_repeat_behind_their_onset(flows) -> None:
    total = Total(tuple(flows))
    onset_ns, length_ns = total.repeat()
    packets = int(total.rate * length_ns)
    spans = list(islice(total.spans(), 3 * packets + int(total.rate * onset_ns) + 50))
    for earlier_ns, later_ns in zip(spans, spans[packets:], strict=False):
        assert later_ns - earlier_ns == length_ns or earlier_ns <= onset_ns


def test_what_comes_as_the_frame_before_ends_still_counts_and_a_full_slot_has_no_bound_in_any_order() -> None:
    """Completions at 11, 21 ..., others at 0, 11, 22 ...: at 121 the twelfth frame ends and the twelfth comes."""
    server = SlotServer(airtime_ns=1, slot_ns=1, period_ns=10)
    assert delay_any_order(Periodic(1000), Periodic(11), server) == Bounded(131)
    full = delay_any_order(Periodic(20), Periodic(20), server)
    assert isinstance(full, Refused)
    assert "full" in full.reason


@given(servers(), st.data())
def test_a_slot_s_output_is_never_denser_than_least_span(server, data) -> None:
    slot = Slot(*server)
    first = data.draw(st.integers(0, server.period_ns - 1))
    end, ends = first, []
    for _ in range(4 * server.frames + 4):
        end = earliest_start(slot, end) + server.airtime_ns
        ends.append(end)
    for n in range(1, len(ends)):
        assert min(ends[i + n - 1] - ends[i] for i in range(len(ends) - n + 1)) >= least_span_ns(server, n)


@examples(80)
@given(servers(), st.lists(periodics(6), min_size=1, max_size=4), st.integers(0, 10**6))
def test_one_slot_fed_by_bursts_never_exceeds_delay_and_backlog(server, flows, seed) -> None:
    total = Total(tuple(flows))
    bound, frames = delay_fifo(total, server), backlog(total, server)
    if isinstance(bound, Refused):
        assert total.rate * server.period_ns > server.frames
        return
    rng = stream(seed, "phases")
    slots = {0: Slot(*server, start_ns=rng.randrange(server.period_ns))}
    seen = network(slots, [(trace(flow, rng), (0,)) for flow in flows])
    assert seen.per_hop[0] <= bound.delay_ns
    assert seen.backlog[0] <= frames


@given(servers(), st.lists(periodics(6), min_size=1, max_size=3))
def test_the_critical_trace_reaches_the_delay_to_one_tick(server, flows) -> None:
    """All flows burst together just after the last start: FIFO delay and backlog are no looser than that."""
    total = Total(tuple(flows))
    bound, frames = delay_fifo(total, server), backlog(total, server)
    if isinstance(bound, Refused) or total.rate * server.period_ns == server.frames:
        return
    start = -(server.slot_ns - server.airtime_ns + 1)
    seen = network({0: Slot(*server, start_ns=start)}, [(spread(flow, 60), (0,)) for flow in flows])
    assert seen.per_hop[0] in (bound.delay_ns, bound.delay_ns - 1)
    assert seen.backlog[0] in (frames, frames - 1)


@given(servers(), periodics(10), periodics(10), st.integers(0, 10**6))
def test_a_flow_that_always_comes_last_stays_within_any_order(server, flow, cross, seed) -> None:
    bound = delay_any_order(flow, cross, server)
    if isinstance(bound, Refused):
        assert (flow.rate + cross.rate) * server.period_ns >= server.frames
        return
    rng = stream(seed, "phases")
    slot = Slot(*server, start_ns=rng.randrange(server.period_ns))
    ours, others = trace(flow, rng), trace(cross, rng, packets=80)
    assert worst_by_priority(slot, ours, others)[0] <= bound.delay_ns


@given(servers(), periodics(10), periodics(3), st.integers(0, 10**6))
def test_an_urgent_flow_keeps_its_bound_when_others_overload_the_slot(server, flow, bulk, seed) -> None:
    bound = delay_any_order(flow, Total(()), server, blocking=1)
    if isinstance(bound, Refused):
        assert flow.rate * server.period_ns >= server.frames
        return
    rng = stream(seed, "phases")
    slot = Slot(*server, start_ns=rng.randrange(server.period_ns))
    urgent, others = trace(flow, rng), trace(bulk, rng, packets=200)
    assert worst_by_priority(slot, others, urgent)[1] <= bound.delay_ns


def worst_by_priority(slot: Slot, ours: list[int], urgent: list[int]) -> tuple[int, int]:
    """The worst delays when `urgent` goes first, decided whenever a frame can start: (ours, urgent)."""
    t, worst = 0, [0, 0]
    waiting = [ours, urgent]
    while any(waiting):
        t = earliest_start(slot, max(t, min(queue[0] for queue in waiting if queue)))
        first = 1 if waiting[1] and waiting[1][0] <= t else 0
        worst[first] = max(worst[first], t + slot.airtime_ns - waiting[first][0])
        waiting[first] = waiting[first][1:]
        t += slot.airtime_ns
    return worst[0], worst[1]


@st.composite
def tandems(draw):
    hops = draw(st.integers(2, 4))
    servers_of = {h: draw(servers()) for h in range(hops)}
    least = max(-(-s.period_ns // s.frames) for s in servers_of.values())
    relay = draw(st.sampled_from([(0, 0), (3, 3), (1, 6)]))
    flows = []
    for _ in range(draw(st.integers(1, 4))):
        path = draw(st.permutations(range(hops)))[: draw(st.integers(1, hops))]
        flows.append(Flow(draw(periodics(4 * least)), tuple(path)))
    return {h: Hop(s, *relay) for h, s in servers_of.items()}, flows


@examples(50)
@given(tandems(), st.integers(0, 10**6))
def test_tandem_slots_in_any_phase_and_direction_never_exceed_the_path_bounds(case, seed) -> None:
    """Paths cross in both directions, so the dependencies have cycles."""
    hops, flows = case
    bounds = path_bounds(flows, hops)
    rng = stream(seed, "phases")
    slots = {h: Slot(*hop.server, start_ns=rng.randrange(hop.server.period_ns)) for h, hop in hops.items()}
    relay = [rng.randint(hops[0].relay_least_ns, hops[0].relay_most_ns) for _ in range(7)]
    seen = network(slots, [(trace(flow.arrivals, rng), flow.path) for flow in flows], relay)
    for bound, worst in zip(bounds.flows, seen.end_to_end, strict=True):
        assert isinstance(bound, Refused) or worst <= bound.delay_ns
    for h, frames in bounds.backlogs.items():
        assert seen.backlog[h] <= frames


def test_path_bounds_answers_for_light_load_and_refuses_overload() -> None:
    server = SlotServer(2, 5, 20)
    light = [Flow(Periodic(100), (0, 1, 2)), Flow(Periodic(100), (2, 1, 0))]
    hops = {h: Hop(server) for h in range(3)}
    assert all(isinstance(bound, Bounded) for bound in path_bounds(light, hops).flows)
    heavy = [*light, Flow(Periodic(9), (1,))]
    found = path_bounds(heavy, hops).flows[0]
    assert isinstance(found, Refused)
    assert "hop 1: unstable" in found.reason


def test_a_burst_makes_the_second_head_s_delay_longer_than_equation_1_says() -> None:
    """Two sources whose jitter at hop 1 lets both bursts meet at hop 2."""
    server = SlotServer(1, 2, 20)
    flows = [Flow(Periodic(20), (0, 2)), Flow(Periodic(20), (1, 2))]
    bounds = path_bounds(flows, {h: Hop(server) for h in range(3)})
    alone = delay_fifo(Total((Periodic(20), Periodic(20))), server)
    second = bounds.hops[2]
    assert isinstance(second, Bounded)
    assert isinstance(alone, Bounded)
    assert second.delay_ns > alone.delay_ns


@given(st.data(), st.integers(1, 4), st.integers(0, 10**6))
def test_slots_in_known_order_never_exceed_the_ordered_tandem(data, hops, seed) -> None:
    airtime, frames = data.draw(st.integers(1, 4)), data.draw(st.integers(1, 3))
    slot = airtime * frames + data.draw(st.integers(0, airtime - 1))
    period = hops * slot + data.draw(st.integers(0, 20))
    starts = [data.draw(st.integers(0, period - 1)) for _ in range(hops)]
    flow = data.draw(periodics(-(-period // frames)))
    server = SlotServer(airtime, slot, period)
    bound = ordered_tandem(flow, [server] * hops, starts)
    assert isinstance(bound, Bounded)
    slots = {h: Slot(*server, start_ns=starts[h]) for h in range(hops)}
    seen = network(slots, [(trace(flow, stream(seed, "t")), tuple(range(hops)))])
    assert seen.end_to_end[0] <= bound.delay_ns


def test_slots_in_the_order_of_the_path_cost_one_period_in_all_and_reversed_one_each() -> None:
    server = SlotServer(1, 5, 20)
    forward = ordered_tandem(Periodic(20), [server] * 4, [0, 5, 10, 15])
    backward = ordered_tandem(Periodic(20), [server] * 4, [15, 10, 5, 0])
    assert forward == Bounded(20 - 5 + 2 + 3 * 5)
    assert backward == Bounded(20 - 5 + 2 + 3 * 15)


def test_a_narrower_slot_downstream_is_refused() -> None:
    assert isinstance(ordered_tandem(Periodic(50), [SlotServer(1, 3, 9), SlotServer(1, 2, 9)], [0, 3]), Refused)


def test_paths_must_name_hops() -> None:
    with pytest.raises(LocalProtocolError, match="path"):
        path_bounds([Flow(Periodic(5), (7,))], {0: Hop(SlotServer(1, 2, 9))})


def test_a_slot_longer_than_its_period_is_refused_by_every_bound() -> None:
    server, flow = SlotServer(1, 10, 9), Periodic(100)
    for bound in (
        lambda: delay_fifo(flow, server),
        lambda: backlog(flow, server),
        lambda: delay_any_order(flow, Total(()), server),
    ):
        with pytest.raises(LocalProtocolError, match="slot_ns = 10"):
            bound()


def test_simulated_delays_of_one_queue_by_hand() -> None:
    """The simulator itself: slot [0, 3) of 10, airtime 2: arrivals 0, 1, 2 leave at 2, 12, 22."""
    assert delays(Slot(2, 3, 10), [0, 1, 2]) == [2, 11, 20]


def test_a_frame_that_has_begun_counts_beside_what_is_more_urgent() -> None:
    """One of ours, two more urgent and three that have begun: six frames, the first of them just too late."""
    server = SlotServer(10, 100, 1000)
    flow, cross = Periodic(10_000), Total((Periodic(10_000), Periodic(10_000)))
    assert delay_any_order(flow, cross, server, blocking=3) == Bounded(1000 - 100 + 10 + 6 * 10)
    assert delay_any_order(flow, cross, server) == Bounded(1000 - 100 + 10 + 3 * 10)
