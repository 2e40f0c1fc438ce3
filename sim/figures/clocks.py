"""Beyond the paper: what wrong clocks cost, and what the common time that hellos carry gives."""

from typing import Final

from sim.figures.curves import PDR, Panel, curves
from sim.figures.finished_runs import Runs, differences
from sim.figures.paper_claims import NEARLY_ALL, Claim, Reason, above, share_above, share_below
from sim.figures.recipe import Recipe


def claims(runs: Runs) -> list[Claim]:
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


FIGURE: Final = Recipe(
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
    claims,
)
