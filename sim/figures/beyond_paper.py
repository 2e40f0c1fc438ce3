"""Figures beyond the paper whose lines are the methods of one sweep: over load, size, wrong clocks, and the age of
positions.
"""

import json
from typing import Final

from sim.figures.curves import P95, PAPERS, PDR, Panel, curves
from sim.figures.finished_runs import Row, Runs, differences, max_per_seed
from sim.figures.paper_claims import NEARLY_ALL, Claim, Reason, above, share_above, share_below
from sim.figures.recipe import Recipe
from sim.figures.style import CONTROL

_RIVALS: Final = ("paper", "flooding", CONTROL, "gossip", "counter")


def _ms_per_delivery(row: Row) -> float | None:
    """The busy time of the channel at a mean station, per packet delivered to it [ms]."""
    per_node, scenario = row["delivered"] / row["nodes"], json.loads(row["scenario"])
    measured_s = scenario["duration_s"] - scenario["warmup_s"] - scenario["drain_s"]
    return row["air.busy"] * measured_s * 1e3 / per_node if per_node else None


def _load_claims(runs: Runs) -> list[Claim]:
    leads = [
        above(
            f"every {at:g} s: PDR of fanet-mw minus the best rival's",
            differences(
                runs.per_seed("pdr", case="ours", traffic__interval_s=at),
                max_per_seed(*(runs.per_seed("pdr", case=case, traffic__interval_s=at) for case in _RIVALS)),
            ),
            0.0,
        )
        for at in reversed(runs.levels("traffic.interval_s"))
    ]
    return [Claim(0, "The timetable delivers more than every rival, at every load.", leads)]


LOAD: Final = Recipe(
    "load",
    "Against all rivals over load",
    "load",
    "45 nodes on the paper's grid, 44 sources of 1024 B to everyone. fanet-mw: the timetable, all are heads, period "
    "4 s. Its delay is that of its turns: who sends seldom has few, and waits longer. The MAC's contention window "
    "(radio.cw_min) is 1 slot for fanet-mw, whose turns need no random backoff, and 31, that of 802.11 DSSS, for the "
    "others; flooding with 1 too is the control.",
    curves(
        "traffic.interval_s",
        "load [packets/s], each to 44 others",
        [PDR, P95, Panel(_ms_per_delivery, "busy air per delivered packet [ms]", log=True)],
        value=lambda interval_s: 44 / interval_s,
        variants={"ours": "fanet-mw: timetable, 4 s", "paper": PAPERS},
    ),
    _load_claims,
)


def _frames_per_packet(row: Row) -> float | None:
    """Frames on the air for each packet that was sent."""
    return row["frames.sent"] / row["generated"] if row["generated"] else None


def _size_claims(runs: Runs) -> list[Claim]:
    largest = runs.levels("nodes.count")[-1]
    delivered = runs.per_seed("pdr", case="counter", nodes__count=largest)
    arrives = share_above(f"{largest} nodes: PDR of counter-based flooding", delivered, NEARLY_ALL)
    return [Claim(0, "Counter-based flooding delivers in the largest swarm.", [arrives])]


SIZE: Final = Recipe(
    "size",
    "45 to 1,000 nodes",
    "size",
    "Grids of the paper's density, ten sources of 256 B a second to everyone. Frames: all of the run, hellos too.",
    curves(
        "nodes.count",
        "nodes",
        [
            Panel("pdr", "packet delivery ratio (from 0.9)", share=True, least=0.9),
            P95,
            Panel(_frames_per_packet, "frames on the air per packet", log=True),
        ],
    ),
    _size_claims,
)


def _clocks_claims(runs: Runs) -> list[Claim]:
    worst = runs.levels("clock.offset_ms")[-1]

    def at_worst(case: str) -> dict[int, float]:
        return runs.per_seed("pdr", case=case, clock__offset_ms=worst)

    carried = at_worst("slack 150 us, hellos carry the time")
    gain = differences(carried, at_worst("slack 50 us"))
    common_time = Reason(
        "It is the common time that does so: without it turns meet, and packets are lost.",
        [
            share_below("slack 50 us: PDR", at_worst("slack 50 us"), NEARLY_ALL),
            above("hellos carry the time minus slack 50 us: PDR", gain, 0.0),
        ],
    )
    return [
        Claim(
            0,
            f"With clocks that are wrong by up to {worst:g} ms the timetable delivers all, once hellos carry the time.",
            [share_above("hellos carry the time: PDR", carried, NEARLY_ALL)],
            [common_time],
        )
    ]


CLOCKS: Final = Recipe(
    "clocks",
    "What wrong clocks cost",
    "clocks",
    "The scenario clusters with clocks that are off by up to so much at the start (and drift by 20 ppm where hellos "
    "carry the time), measured at 0, 0.5, 2 and 10 ms. Slack: what a turn is longer than its frame. fanet-mw: the "
    "timetable, all are heads, period 0.5 s. Delays are of what arrives.",
    curves(
        "clock.offset_ms",
        "greatest clock error at the start [ms]",
        [PDR, Panel("delay_ms.p95", "95th percentile of the delay [s]", factor=1e-3)],
        linear=True,
    ),
    _clocks_claims,
)


def _age_claims(runs: Runs) -> list[Claim]:
    def youngest(case: str) -> dict[int, float]:
        """The least age over all intervals, for each seed."""
        levels = runs.levels("traffic.interval_s")
        negative = [runs.per_seed(lambda row: -row["age_s"], case=case, traffic__interval_s=at) for at in levels]
        return {seed: -age for seed, age in max_per_seed(*negative).items()}

    older = [
        above(f"{case}: least age minus the timetable's", differences(youngest(case), youngest("ours")), 0.0, "s")
        for case in ("flooding", "paper")
    ]
    return [Claim(0, "At its best interval each method's positions are older than the timetable's.", older)]


AGE: Final = Recipe(
    "age",
    "Age of positions",
    "age",
    "Each of 44 UAVs sends 64 B to everyone, as often as the horizontal axis says. Age: how long ago the newest "
    "position was taken that a UAV has of another one, mean over time and pairs. fanet-mw: the timetable, all are "
    "heads, period 0.5 s, radio.cw_min 7, the others 31. To send seldom is to know old "
    "positions, to send too often is to lose them.",
    curves(
        "traffic.interval_s",
        "a position of each UAV every [s]",
        [Panel("age_s", "mean age of information [s]", log=True), PDR],
        variants={"ours": "fanet-mw: timetable, 0.5 s", "paper": PAPERS},
    ),
    _age_claims,
)
