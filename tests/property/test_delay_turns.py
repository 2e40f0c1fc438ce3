"""A head with turns at known places: no trace is worse than the bounds, and the worst trace comes within one tick."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples
from test_delay_network import periodics, spread, trace

from fanet_mw.bounds import Bounded, Periodic, Refused, Total, TurnServer, backlog, delay_any_order, delay_fifo
from fanet_mw.errors import LocalProtocolError
from fanet_mw.rng import stream


@st.composite
def turn_servers(draw):
    airtime = draw(st.integers(1, 6))
    period = draw(st.integers(4 * airtime, 80))
    places = draw(st.lists(st.integers(0, period // airtime - 1), min_size=1, max_size=4, unique=True))
    return TurnServer(airtime, period, tuple(airtime * place for place in sorted(places)), draw(st.integers(0, 9)))


def serve(server: TurnServer, bulk, urgent=(), *, start: int = 0):
    """Turn by turn: the most urgent packet announced in time goes. Worst delays (bulk, urgent), most waiting."""
    queues, worst, most = [sorted(urgent), sorted(bulk)], [0, 0], 0
    turn = 0
    while any(queues):
        at = start + turn // server.frames * server.period_ns + server.starts_ns[turn % server.frames]
        turn += 1
        ready = [i for i in (0, 1) if queues[i] and queues[i][0] <= at - server.lead_ns]
        end = at + server.airtime_ns
        most = max(most, sum(1 for queue in queues for t in queue if t <= end - 1))
        if ready:
            worst[ready[0]] = max(worst[ready[0]], end - queues[ready[0]].pop(0))
    return worst[1], worst[0], most


@examples(50)
@given(turn_servers(), st.lists(periodics(15), min_size=1, max_size=3), st.integers(0, 10**6))
def test_no_trace_exceeds_delay_or_backlog_of_turns(server, flows, seed) -> None:
    total = Total(tuple(flows))
    bound, frames = delay_fifo(total, server), backlog(total, server)
    if isinstance(bound, Refused):
        assert total.rate * server.period_ns > server.frames
        return
    rng = stream(seed, "turns")
    arrivals = [at for flow in flows for at in trace(flow, rng)]
    worst, _, most = serve(server, arrivals, start=-rng.randrange(server.period_ns))
    assert worst <= bound.delay_ns
    assert most <= frames


@given(turn_servers(), periodics(15))
def test_the_worst_phase_of_a_burst_comes_within_one_tick(server, flow) -> None:
    bound = delay_fifo(flow, server)
    if isinstance(bound, Refused) or flow.rate * server.period_ns == server.frames:
        return
    worst = max(serve(server, [t + at for t in spread(flow, 40)])[0] for at in range(100, 100 + server.period_ns))
    assert worst == bound.delay_ns - 1


@given(turn_servers(), periodics(15), periodics(4), st.integers(0, 10**6))
def test_urgent_packets_keep_their_bound_among_bulk_that_overloads_the_turns(server, flow, bulk, seed) -> None:
    bound = delay_any_order(flow, Total(()), server)
    if isinstance(bound, Refused):
        return
    rng = stream(seed, "turns")
    _, worst, _ = serve(server, trace(bulk, rng, packets=80), trace(flow, rng), start=-rng.randrange(server.period_ns))
    assert worst <= bound.delay_ns


@given(turn_servers())
def test_service_is_the_inverse_of_completion_and_under_its_line(server) -> None:
    for n in range(1, 15):
        assert server.served(server.completion_ns(n)) >= n
        assert server.served(server.completion_ns(n) - 1) < n
        assert server.completion_ns(n) * server.frames <= server.latency_ns * server.frames + n * server.period_ns


def test_turns_spread_over_the_superframe_halve_the_wait_of_turns_in_a_row() -> None:
    together, apart = TurnServer(1, 100, (0, 1)), TurnServer(1, 100, (0, 50))
    assert delay_fifo(Periodic(100), together) == Bounded(99 + 1)
    assert delay_fifo(Periodic(100), apart) == Bounded(50 + 1)


@pytest.mark.parametrize("starts", [(5, 3), (0, 1), (0, 99), (0, 100)])
def test_turns_that_overlap_or_lie_outside_are_our_callers_mistake(starts) -> None:
    with pytest.raises(LocalProtocolError, match="starts_ns"):
        TurnServer(2, 100, starts).check()
