"""How tight the bounds are, and how often equation (4) fails: `python tests/benchmarks/delay_bound.py [CASES]`.

One slot: random feasible C, S, P, p against exact simulation, 500 phases (the critical one among them) x 80 packets,
and the same draws made unstable. Tandems: random paths over 2-4 slots against the worst of 40 random traces.
"""

import statistics
import sys
from pathlib import Path
from random import Random

sys.path.append(str(Path(__file__).parents[1] / "property"))
sys.path.append(str(Path(__file__).parents[1] / "validation"))

from access_bound import ContendingTraffic, access_bound
from single_slot_bound import single_slot_bound
from slot_simulator import Slot, delays, network
from tandem_bounds import Flow, Hop, path_bounds

from fanet_mw.airtime import OVERHEAD_BYTES, frame_ns
from fanet_mw.bounds import (
    Bounded,
    Dcf,
    Periodic,
    SlotServer,
    Total,
    delay_fifo,
    paper,
)
from fanet_mw.rng import stream
from fanet_mw.units import MS, US

PHASES = 500
PACKETS = 80


def draw(rng: Random, *, load: float) -> tuple[SlotServer, int]:
    """A slot and an interval at about this load: k p = P / load."""
    airtime = rng.randint(100 * US, 10 * MS)
    slot = int(airtime * rng.uniform(1, 8))
    server = SlotServer(airtime, slot, int(slot * rng.uniform(1.05, 20)))
    return server, int(server.period_ns / server.frames / load) + 1


def worst_seen(server: SlotServer, interval: int, rng: Random) -> int:
    slot = Slot(*server)
    last_start = server.slot_ns - server.airtime_ns
    phases = [last_start + 1, *(rng.randrange(server.period_ns) for _ in range(PHASES - 1))]
    return max(max(delays(slot, [phase + n * interval for n in range(PACKETS)])) for phase in phases)


def estimate(server: SlotServer, interval: int) -> int | None:
    found = paper.cluster_estimate(
        airtime_ns=server.airtime_ns, slot_ns=server.slot_ns, period_ns=server.period_ns, interval_ns=interval
    )
    return found.delay_ns if isinstance(found, Bounded) else None


def one_slot(cases: int) -> None:
    rng = stream(1, "delay_bound")
    tightness, tightness_4, violated, violated_4, gap = [], [], 0, 0, []
    for _ in range(cases):
        server, interval = draw(rng, load=rng.uniform(0.2, 1))
        seen = worst_seen(server, interval, rng)
        bound = single_slot_bound(server, interval_ns=interval)
        assert isinstance(bound, Bounded)
        tightness.append(seen / bound.delay_ns)
        gap.append(bound.delay_ns - seen)
        violated += seen > bound.delay_ns
        equation_4 = estimate(server, interval)
        if equation_4 is not None:
            tightness_4.append(seen / equation_4)
            violated_4 += seen > equation_4
    print(f"one slot, {cases} feasible cases, {PHASES} phases x {PACKETS} packets")
    median = statistics.median(tightness)
    print(f"  bound:        violated {violated}, tightness median {median:.6f}, worst gap {max(gap)} ns")
    print(
        f"  equation (4): violated {violated_4} ({100 * violated_4 / cases:.0f} %), "
        f"seen / estimate median {statistics.median(tightness_4):.3f}, greatest {max(tightness_4):.3f}"
    )
    accepted = refused = 0
    for _ in range(cases):
        server, interval = draw(rng, load=rng.uniform(1.001, 1.5))
        refused += not isinstance(single_slot_bound(server, interval_ns=interval), Bounded)
        accepted += estimate(server, interval) is not None
    print(f"one slot, {cases} unstable cases (load 1-1.5): refused {refused}; accepted by equation (4): {accepted}")


def trace(flow: Periodic, rng: Random) -> list[int]:
    phase, turn = rng.randrange(flow.interval_ns), rng.randrange(PACKETS)
    return sorted(phase + n * flow.interval_ns + (flow.jitter_ns if n < turn else 0) for n in range(PACKETS))


def tandems(cases: int) -> None:
    rng = stream(1, "tandems")
    ratios: list[float] = []
    violated = refused = 0
    for _ in range(cases):
        server, _ = draw(rng, load=1)
        hops = {h: Hop(server) for h in range(rng.randint(2, 4))}
        share = server.period_ns // server.frames
        flows = []
        for _ in range(rng.randint(2, 4)):
            path = rng.sample(range(len(hops)), rng.randint(1, len(hops)))
            interval = int(share * rng.uniform(4, 12))
            flows.append(Flow(Periodic(interval, rng.randint(0, interval)), tuple(path)))
        bounds = path_bounds(flows, hops).flows
        seen = [0] * len(flows)
        for _ in range(40):
            slots = {h: Slot(*hop.server, start_ns=rng.randrange(server.period_ns)) for h, hop in hops.items()}
            found = network(slots, [(trace(flow.arrivals, rng), flow.path) for flow in flows]).end_to_end
            seen = [max(a, b) for a, b in zip(seen, found, strict=True)]
        for bound, worst in zip(bounds, seen, strict=True):
            if isinstance(bound, Bounded):
                ratios.append(worst / bound.delay_ns)
                violated += worst > bound.delay_ns
            else:
                refused += 1
    print(
        f"tandems, {cases} cases, {len(ratios)} flows bounded, {refused} refused: violated {violated}, "
        f"seen / bound median {statistics.median(ratios):.3f}, greatest {max(ratios):.3f}"
    )


def aggregates(cases: int) -> None:
    rng = stream(1, "aggregates")
    ratios: list[float] = []
    for _ in range(cases):
        server, share = draw(rng, load=0.9)
        count = rng.randint(2, 6)
        flows = [Periodic(share * count, rng.randint(0, 2 * share * count)) for _ in range(count)]
        bound = delay_fifo(Total(tuple(flows)), server)
        assert isinstance(bound, Bounded)
        slot = Slot(*server, start_ns=-(server.slot_ns - server.airtime_ns + 1))
        critical = [[max(0, n * f.interval_ns - f.jitter_ns) for n in range(PACKETS)] for f in flows]
        seen = network({0: slot}, [(at, (0,)) for at in critical]).per_hop[0]
        ratios.append(seen / bound.delay_ns)
    print(
        f"bursty aggregates in one slot, {cases} cases, critical trace: seen / bound median "
        f"{statistics.median(ratios):.6f}, least {min(ratios):.6f}, greatest {max(ratios):.6f}"
    )


def access() -> None:
    frame = frame_ns(1024 + 100 + OVERHEAD_BYTES, rate_mbps=11, short=False)
    for stations in (1, 2, 5, 12, 23):
        for attempts in (3, 7):
            found = access_bound(Dcf(attempts=attempts), frame, ContendingTraffic(stations, frame))
            assert isinstance(found, Bounded)
            what = f"{stations} stations, one {frame / US:.0f} us frame each, {attempts} attempts"
            print(f"access, {what}: {found.delay_ns / MS:.1f} ms")


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 600
    one_slot(number)
    aggregates(number)
    tandems(max(1, number // 6))
    access()
