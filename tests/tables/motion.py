"""Measured tables of packets in motion: four methods, urgent packets, deaths, one receiver, costs of rounds."""

import time
from collections.abc import Mapping
from typing import Any, Final

from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.units import MS
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from tests.tables.markdown import Rows
from tests.tables.summaries import summarized

_CONTENDING: Final = ("radio.cw_min=31", "clusters.count=4", "clusters.flooding_period_s=1")
_ROUNDS: Final = ("routing.protocol=rounds",)
METHODS: Final[Mapping[str, tuple[str, ...]]] = {
    "plain flooding": ("routing.protocol=flooding", "routing.jitter_ms=20", "radio.cw_min=31"),
    "`all` (the paper's)": ("clusters.relay=all", *_CONTENDING),
    "`scheduled`": (),
    "`rounds`": _ROUNDS,
}
MOTIONS: Final[Mapping[str, tuple[str, ...]]] = {
    "at rest": (),
    "formation, 10 m/s": ("mobility.model=formation", "mobility.speed_m_s=10"),
    "random waypoints, 10 m/s": ("mobility.model=random_waypoint", "mobility.speed_m_s=10", "world.area_m=900"),
}
_DURATION: Final = ("duration_s=50", "drain_s=12", "routing.lifetime_s=10")
"""Drains last longer than packets live, so nothing that is late counts as lost."""
_URGENT: Final = (
    *_ROUNDS, *_DURATION, "traffic.payload_bytes=100", "traffic.priority=report", "rounds.bulk_share=0"
)  # fmt: skip
_SIZES: Final = (10, 45, 100, 200)


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def methods() -> Rows:
    """Four methods side by side: 45 UAVs, 44 of them send 1,024 bytes a second to all, at 11 Mb/s."""
    rows = [[
        "motion", "method", "delivered", "of reachable", "bound stated", "within it", "p50 [ms]", "p95 [ms]",
        "worst [ms]", "air busy", "MB sent",
    ]]  # fmt: skip
    for motion, moves in MOTIONS.items():
        for method, keys in METHODS.items():
            found = summarized("clusters", *keys, *moves, *_DURATION)
            delay, bound = found["delay_ms"], found["bound"]
            rows.append([
                motion, method, _share(found["pdr"]), _share(found["reachable"]["traffic"]["pdr"]),
                _share(bound.get("stated_share")), _share(bound.get("within_share")),
                *(_ms(delay[name]) for name in ("p50", "p95", "max")), f"{found['air']['busy']:.2f}",
                f"{found['air']['throughput_mbps'] * 50 / 8:.0f}",
            ])  # fmt: skip
    return rows


def urgent() -> Rows:
    """Urgent packets in rounds while UAVs move, meet, part and fail: 44 sources of 100 bytes a second."""
    walking = ("mobility.model=random_waypoint", "world.area_m=900")
    settings: dict[str, tuple[str, ...]] = {
        **{f"random waypoints, {v} m/s": (*walking, f"mobility.speed_m_s={v}") for v in (5, 10, 20)},
        "formation at 10 m/s, the air between two halves cut from 20 to 30 s": (
            *MOTIONS["formation, 10 m/s"],
            'faults=[{kind="partition",at_s=20,for_s=10,nodes=[' + ",".join(map(str, range(1, 23))) + "]}]",
        ),
        "formation at 10 m/s, UAVs 1, 12 and 23 fall silent at 20, 24 and 28 s": (
            *MOTIONS["formation, 10 m/s"],
            'faults=[{kind="mute",at_s=20,node=1},{kind="mute",at_s=24,node=12},{kind="mute",at_s=28,node=23}]',
        ),
        "formation at 10 m/s, a tenth of all frames lost": (
            *MOTIONS["formation, 10 m/s"], 'faults=[{kind="degrade",at_s=1,loss_share=0.1}]',
        ),
        "formation at 10 m/s, shadowing of 4 dB": (
            *MOTIONS["formation, 10 m/s"], "radio.channel=log_distance", "radio.shadowing_db=4",
        ),
        "formation at 10 m/s, Rician fading": (
            *MOTIONS["formation, 10 m/s"], "radio.channel=log_distance", "radio.fading=rician", "radio.rician_k_db=10",
        ),
    }  # fmt: skip
    rows = [[
        "setting", "delivered", "of reachable", "bound stated", "within it", "broken", "likely stated", "within that",
        "p50 [ms]", "p95 [ms]", "worst [ms]",
    ]]  # fmt: skip
    for name, keys in settings.items():
        found = summarized("clusters", *_URGENT, *keys)
        delay, bound, likely = found["delay_ms"], found["bound"], found["likely"]
        broken = bound.get("violations") or 0
        rows.append([
            name, _share(found["pdr"]), _share(found["reachable"]["traffic"]["pdr"]), _share(bound.get("stated_share")),
            _share(bound.get("within_share")), str(broken),
            _share(likely.get("stated_share")), _share(likely.get("within_share")),
            *(_ms(delay[key]) for key in ("p50", "p95", "max")),
        ])  # fmt: skip
    return rows


def costs() -> Rows:
    """What rounds cost as swarms grow: an urgent packet of 100 bytes every 5 s from each UAV, and nothing else."""
    rows = [["UAVs", "round [ms]", "hop of the bound [ms]", "air busy", "p95 [ms]", "worst [ms]", "CPU a UAV [ms/s]"]]
    for count in _SIZES:
        keys = (*_URGENT, "rounds.bulk_share=0.7", "traffic.interval_s=5", f"nodes.count={count}")
        keys += (f"traffic.sources={count - 1}", "clusters.count=1")
        scenario = catalog.find("clusters", [*keys, "duration_s=40"])
        timing = RoundTiming.of(scenario)
        began = time.process_time()
        found: dict[str, Any] = finish(simulate(scenario), out=None)
        cpu_ms = 1000 * (time.process_time() - began) / count / 40
        delay = found["delay_ms"]
        rows.append([
            str(count), f"{timing.period_ns / MS:.0f}", f"{(timing.period_ns + timing.turn_ns) / MS:.0f}",
            f"{found['air']['busy']:.3f}", _ms(delay["p95"]), _ms(delay["max"]), f"{cpu_ms:.1f}",
        ])  # fmt: skip
    return rows


def one_receiver() -> Rows:
    """Packets for one node, in rounds, clustered, and by protocols that keep routes: 44 sources of 1,024 bytes a
    second.
    """
    rows = [[
        "motion", "protocol", "delivered", "of reachable", "p50 [ms]", "p95 [ms]", "worst [ms]",
        "frames, control included",
    ]]  # fmt: skip
    for motion, moves in MOTIONS.items():
        for protocol in ("rounds", "counter", "aodv", "olsr", "dsdv", "geographic"):
            chosen = "clusters.relay" if protocol == "counter" else "routing.protocol"
            keys = (f"{chosen}={protocol}", "traffic.destination=12")
            found = summarized("clusters", *keys, *moves, *_DURATION)
            delay = found["delay_ms"]
            rows.append([
                motion, f"`{protocol}`", _share(found["pdr"]), _share(found["reachable"]["traffic"]["pdr"]),
                *(_ms(delay[name]) for name in ("p50", "p95", "max")), f"{found['frames']['sent']:,}",
            ])  # fmt: skip
    return rows
