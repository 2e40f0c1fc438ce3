"""Beyond the paper: the improved protocol against its rivals over load, and what each mechanism adds."""

from typing import Final

from sim.figures.claims import Claim, Statement
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.runs import Row, Runs, best, differences
from sim.figures.style import LOOKS, SERIES, canvas, line

_RIVALS: Final = ("paper", "flooding", "gossip", "counter")


def _ms_per_delivery(row: Row) -> float | None:
    """Time that the air is busy at a mean station, per packet delivered to it [ms]."""
    per_node = row["delivered"] / row["nodes"]
    return row["air.busy"] * row["duration_s"] * 1e3 / per_node if per_node else None


def draw_load(runs: Runs) -> Drawing:
    figure, (pdr, p95, cost) = canvas(3)
    data = []
    panels = (
        (pdr, "pdr", "packet delivery ratio"),
        (p95, "delay_ms.p95", "95th percentile of the delay [ms]"),
        (cost, _ms_per_delivery, "busy air per delivered packet [ms]"),
    )
    intervals = runs.levels("traffic.interval_s")
    loads = [44 / at for at in intervals]
    for axes, quantity, label in panels:
        for case in ("ours", *_RIVALS):
            found = [runs.of(quantity, case=case, traffic__interval_s=at) for at in intervals]
            line(axes, LOOKS[case], loads, found)
            data += [
                point(one, panel=label, series=case, packets_per_s=load) for one, load in zip(found, loads, strict=True)
            ]
        axes.set_xscale("log")
        axes.set_xlabel("load [packets/s], each to 44 others")
        axes.set_ylabel(label)
    pdr.set_ylim(0, 1.05)
    for axes in (p95, cost):
        axes.set_yscale("log")
    pdr.legend(loc="lower left")
    return Drawing(figure, data)


def claims_load(runs: Runs) -> list[Claim]:
    statements = [
        Statement(
            f"every {at:g} s: PDR of fanet-mw minus the best rival's",
            differences(
                runs.per_seed("pdr", case="ours", traffic__interval_s=at),
                best(*(runs.per_seed("pdr", case=case, traffic__interval_s=at) for case in _RIVALS)),
            ),
            "above",
            0.0,
        )
        for at in reversed(runs.levels("traffic.interval_s"))
    ]
    return [Claim(0, "(Beyond the paper) The timetable delivers more than every rival, at every load.", statements)]


def draw_ablation(runs: Runs) -> Drawing:
    figure, (pdr, p95, busy) = canvas(3, height=3.0, width=3.6, share_y=True)
    cases = list(dict.fromkeys(row["case"] for row in runs.rows))
    data = []
    for axes, column, label, factor in (
        (pdr, "pdr", "packet delivery ratio", 1.0),
        (p95, "delay_ms.p95", "95th percentile of the delay [s]", 1e-3),
        (busy, "air.busy", "share of time the air is busy", 1.0),
    ):
        found = [runs.of(column, case=case) for case in cases]
        reach = [0.0 if one.runs < 2 else (one.high - one.mean) * factor for one in found]
        axes.barh(cases, [one.mean * factor for one in found], xerr=reach, color=SERIES[0].color, height=0.6)
        axes.set_xlabel(label)
        data += [point(one, panel=column, mechanism=case) for one, case in zip(found, cases, strict=True)]
    pdr.set_xlim(0, 1.05)
    pdr.invert_yaxis()
    return Drawing(figure, data)


LOAD: Final = Recipe(
    "load",
    "Against all rivals over load",
    "load",
    "45 nodes on the paper's grid, 44 sources of 1024 B to everyone. fanet-mw: the timetable, all are heads, period "
    "4 s. Its delay is that of its turns, long at low load and hardly longer at high load.",
    draw_load,
    claims_load,
)
ABLATION: Final = Recipe(
    "ablation",
    "What each mechanism adds",
    "ablation",
    "44 sources, 1024 B every 0.5 s to everyone, 44 clusters, flooding period 0.5 s. Each row adds a mechanism to the "
    "one above; the last replaces contention among relays by a timetable.",
    draw_ablation,
)
