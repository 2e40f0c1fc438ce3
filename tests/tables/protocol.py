"""Measured tables of the protocol. Each costs minutes; what two tables need is measured once."""

import statistics
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from sim.results.links_over_time import connectivity
from sim.scenarios import catalog
from tests.benchmarks import (
    clock_sync,
    collision_warnings,
    false_assumptions,
    message_cost,
    protocol_cost,
    relay_failure,
)
from tests.tables.markdown import Rows
from tests.tables.summaries import summarized

_SPEEDS: Final = (0, 10, 20)
_SEEDS: Final = (1, 2, 3)
_DEATHS: Final = 20
"""Relays that fall silent, one per run."""
_MOST_PER_S: Final = 776
"""Packets of 1024 B a second that can reach all of the 9 x 5 grid (`sim/planner/goodput_bound.py`)."""
_LOADED: Final = {
    "scheduled, period 4 s, `cw_min` 1, `turn_slack_us` 20, `contention_ms` 20, `hello_interval_s` 2": (
        "clusters.flooding_period_s=4", "radio.cw_min=1", "clusters.turn_slack_us=20", "clusters.contention_ms=20",
        "routing.hello_interval_s=2",
    ),
    "scheduled, period 1 s, `cw_min` 1": ("clusters.flooding_period_s=1", "radio.cw_min=1"),
    "scheduled, 0.5 s, `cw_min` 7": ("clusters.flooding_period_s=0.5", "radio.cw_min=7"),
    "clustered, relays `all`, 44 clusters, 0.5 s": ("clusters.relay=all", "clusters.flooding_period_s=0.5"),
    "clustered, `counter` = 2, 44 clusters, 0.5 s, no repair": (
        "clusters.relay=counter", "clusters.counter=2", "clusters.flooding_period_s=0.5", "clusters.repair_s=0",
    ),
    "clustered, `counter` = 2, 4 clusters, 5 s, no repair": (
        "clusters.relay=counter", "clusters.counter=2", "clusters.count=4", "clusters.flooding_period_s=5",
        "clusters.repair_s=0",
    ),
    "plain flooding": ("routing.protocol=flooding", "routing.hello_interval_s=0"),
}  # fmt: skip


_BOUNDED: Final = (
    (44, 0.5, "range"), (44, 1, "range"), (44, 0.5, "log_distance"), (8, 0.5, "range"), (4, 0.5, "range"),
    (22, 0.5, "range"),
)  # fmt: skip
_DISTURBED: Final = (
    ("mission.survivors=16", "mission.reports_to_approach=46"),
    ("mission.survivors=16",),
    ("traffic.arrivals=poisson",),
    ("radio.lead_ms=40", "radio.handover_ms=20"),
    ("clusters.repair_s=20",),
    ("radio.channel=log_distance", "radio.shadowing_db=4"),
    ("radio.channel=log_distance", "radio.fading=rician", "radio.scatterer_speed_m_s=100"),
)


def bounds() -> Rows:
    """Scenario `clusters`: deliveries from application to application, under what their origins stated."""
    rows = [
        [
            "`clusters.count`",
            "flooding period",
            "channel",
            "PDR, seeds 1-3",
            "within",
            "worst delay / bound [ms]",
            "broken",
        ]
    ]
    for count, period_s, channel in _BOUNDED:
        keys = (f"clusters.count={count}", f"clusters.flooding_period_s={period_s}", f"radio.channel={channel}")
        rows.append([f"{count}", f"{period_s:g} s", f"`{channel}`", *_bound_cells(keys)])
    return rows


def promises() -> Rows:
    """The same with what may break a bound, or leave a packet without one."""
    rows = [["changed", "PDR, seeds 1-3", "packets with a bound", "within", "worst delay / bound [ms]", "broken"]]
    for keys in _DISTURBED:
        found = [summarized("clusters", "duration_s=30", f"seed={seed}", *keys)["bound"] for seed in _SEEDS]
        stated = statistics.fmean(bound.get("stated_share", 0.0) for bound in found)
        pdr, *cells = _bound_cells(keys)
        rows.append([", ".join(f"`{key}`" for key in keys), pdr, f"{stated:.3f}", *cells])
    return rows


def lossy() -> Rows:
    """Scenario `clusters` over links that lose frames: timetables from measured links, and one from places beside it.

    `stated`: the share of packets with a likely delay, and the longest that any node stated; `within`: how many of
    their copies came within it.
    """
    head = ["`KEY`", "seed", "PDR with places, 30 s", "PDR measured", "median / p95 delay [ms]"]
    rows = [[*head, "stated: share / at worst [s]", "within"]]
    for key in ("radio.shadowing_db=4", "radio.fading=rician"):
        for seed in _SEEDS:
            keys = ("radio.channel=log_distance", key, "radio.scatterer_speed_m_s=100", f"seed={seed}")
            found = summarized("clusters", "duration_s=60", *keys)
            places = summarized("clusters", "duration_s=30", "clusters.links=places", *keys)
            delay_ms, likely = found["delay_ms"], found["likely"]
            rows.append(
                [
                    f"`{key}`",
                    f"{seed}",
                    f"{places['pdr']:.3f}",
                    f"{found['pdr']:.3f}",
                    f"{delay_ms['p50']:.0f} / {delay_ms['p95']:.0f}",
                    f"{likely['stated_share']:.2f} / {likely['worst_ms'] / 1000:.1f}",
                    f"{likely['within_share']:.4f}",
                ]
            )
    return rows


def _bound_cells(keys: Sequence[str]) -> list[str]:
    """PDR, share within the bound, the worst delay and the bound, and how often it was broken."""
    found = [summarized("clusters", "duration_s=30", f"seed={seed}", *keys) for seed in _SEEDS]
    stated = [summary["bound"] for summary in found if summary["bound"]]
    pdr = f"{statistics.fmean(summary['pdr'] for summary in found):.4f}"
    if not stated:
        return [pdr, "-", "-", "-"]
    within = statistics.fmean(bound["within_share"] for bound in stated)
    worst = max(stated, key=lambda bound: float(bound["observed_max_ms"] / bound["worst_ms"]))
    broken = sum(bound["violations"] for bound in stated)
    return [pdr, f"{within:.4f}", f"{worst['observed_max_ms']:.0f} / {worst['worst_ms']:.0f}", f"{broken}"]


def warnings() -> Rows:
    """Scenario `crossing`: what collision warnings are worth, and how they fare under load."""
    return collision_warnings.rows(seeds=len(_SEEDS))


def goodput() -> Rows:
    """44 sources every 0.1 s on the grid: deliveries over receivers and seconds."""
    rows = [["protocol", "PDR", "goodput [packets/s]", "of the bound", "p95 delay"]]
    for name, keys in _LOADED.items():
        summary = summarized("clusters", "duration_s=28", "traffic.interval_s=0.1", *keys)
        per_second = 440 * summary["pdr"]
        share = per_second / _MOST_PER_S
        p95_s = summary["delay_ms"]["p95"] / 1000
        rows.append(
            [name, f"{summary['pdr']:.3f}", f"{per_second:.0f}", f"{share:.0%}".replace("%", " %"), f"{p95_s:.2f} s"]
        )
    return rows


def rivals() -> Rows:
    """Scenario `rivals`: protocols that the reference does not have."""
    rows = [["protocol", "PDR at 0 / 10 / 20 m/s", "mean delay [ms]", "frames per packet"]]
    for name in ("geographic", "dsdv", "gossip", "counter", "flooding"):
        keys = [[f"routing.protocol={name}", f"mobility.speed_m_s={speed}"] for speed in _SPEEDS]
        found = [[summarized("rivals", *chosen, f"seed={seed}") for seed in _SEEDS] for chosen in keys]
        pdr = [f"{statistics.fmean(s['pdr'] for s in runs):.3f}" for runs in found]
        delay = [f"{statistics.fmean(s['delay_ms']['mean'] or 0.0 for s in runs):.1f}" for runs in found]
        sent = [f"{statistics.fmean(s['frames']['sent'] / s['generated'] for s in runs):.1f}" for runs in found]
        rows.append([f"`{name}`", " / ".join(pdr), " / ".join(delay), " / ".join(sent)])
    bounds = [
        [connectivity(catalog.find("rivals", [f"mobility.speed_m_s={speed}", f"seed={seed}"])) for seed in _SEEDS]
        for speed in _SPEEDS
    ]
    return [*rows, ["`conn`", " / ".join(f"{statistics.fmean(shares):.3f}" for shares in bounds), "", ""]]


def cost() -> Rows:
    """What each protocol costs a node."""
    return protocol_cost.rows(60.0)


def dead_relays() -> Rows:
    """How long a dead relay of a timetable cuts others off, with few sources and with many."""
    cases = ((10, 50.0), (44, 30.0))
    rows = [
        relay_failure.row(
            [relay_failure.nth(run, seconds=seconds, sources=sources) for run in range(1, _DEATHS + 1)], sources=sources
        )
        for sources, seconds in cases
    ]
    return [relay_failure.HEAD, *rows]


def assumptions() -> Rows:
    """What timetables do when what they assume is false."""
    return false_assumptions.swarms()


def phones() -> Rows:
    """How far off a phone's place is when its power is not what is assumed."""
    return false_assumptions.phones()


def cost_of_messages() -> Rows:
    """What a message costs beside a packet of load."""
    return message_cost.rows(1000)


def clock_errors() -> Rows:
    return _clocks().errors


def clocks() -> Rows:
    return _clocks().cases


@lru_cache(maxsize=1)
def _clocks() -> clock_sync.Measured:
    return clock_sync.measured(seeds=len(_SEEDS))
