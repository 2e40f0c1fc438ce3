"""Figure 11: delays of flooding, of the paper's method, and of the timetable. Claims: means, tails and the 0.5 s."""

import math
from collections.abc import Callable
from itertools import accumulate
from typing import Final

from fanet_mw.bounds.delay_bound import Bounded
from fanet_mw.bounds.paper import cluster_estimate
from fanet_mw.units import MS
from sim.figures.claims import Claim, Statement
from sim.figures.recipe import Drawing, Recipe
from sim.figures.runs import Quantity, Row, Runs, differences
from sim.figures.style import LOOKS, canvas
from sim.sweep.measures import DELAY_EDGES_S

_CASES: Final = ("flooding", "paper", "ours")
_WITHIN_S: Final = 0.5
_LONG: Final = 0.01
_PERIOD_S: Final = 0.5
_INTERVAL_S: Final = 0.1
_SOURCES: Final = 44
_CLUSTERS: Final = 8
_CLASSES: Final = 4
"""Classes of `delay_counts` that are drawn as one bar of the histogram."""


def paper_bound_s() -> float | None:
    """The paper's worst case for one cluster with the slot of its equations; None where they give no number.

    In units of the generation period of a cluster, of which its flooding period holds a whole number: the equations
    with exact fractions would otherwise look at slots by the million.
    """
    packets = math.ceil(_SOURCES / _CLUSTERS * _PERIOD_S / _INTERVAL_S)
    found = cluster_estimate(airtime_ns=1, slot_ns=None, period_ns=packets * MS, interval_ns=MS)
    return found.delay_ns / (packets * MS) * _PERIOD_S if isinstance(found, Bounded) else None


def _share_within(limit_s: float, *, of_all: bool) -> Callable[[Row], float]:
    """Deliveries within a limit, of all packets x targets or of the deliveries."""
    last = next(number for number, edge in enumerate(DELAY_EDGES_S) if edge >= limit_s * 0.999)

    def share(row: Row) -> float:
        counts = row["delay_counts"]
        whole = row["wanted"] if of_all else sum(counts)
        return sum(counts[: last + 1]) / whole if whole else math.nan

    return share


def _mean_shares(runs: Runs, case: str) -> list[float]:
    """Of each class of delay, its share of packets x targets, on average over the seeds."""
    rows = runs.where(case=case)
    columns = zip(*([count / row["wanted"] for count in row["delay_counts"]] for row in rows), strict=True)
    return [sum(column) / len(rows) for column in columns]


def draw(runs: Runs) -> Drawing:
    figure, (histogram, cdf) = canvas(2)
    data = []
    edges = [0.0, *DELAY_EDGES_S]
    for case in _CASES:
        if not runs.where(case=case):
            continue
        shares, look = _mean_shares(runs, case), LOOKS[case]
        sums = list(accumulate(shares))
        cdf.plot(DELAY_EDGES_S, sums[: len(DELAY_EDGES_S)], color=look.color, linestyle=look.dash, label=look.label)
        bars = [sum(shares[start : start + _CLASSES]) for start in range(0, len(DELAY_EDGES_S), _CLASSES)]
        histogram.stairs(
            bars[: len(edges[:: _CLASSES]) - 1], edges[::_CLASSES][: len(bars) + 1], color=look.color,
            linestyle=look.dash, label=look.label, linewidth=1.6,
        )  # fmt: skip
        data += [
            {"series": case, "delay_s": edge, "share": share, "cdf": total}
            for edge, share, total in zip(DELAY_EDGES_S, shares, sums, strict=False)
        ]
    paper, ours = paper_bound_s(), max(runs.per_seed("bound.worst_ms", case="ours").values(), default=None)
    for axes in (histogram, cdf):
        if paper is not None:
            axes.axvline(paper, color=LOOKS["paper"].color, linewidth=0.9, label=f"the paper's bound, {paper:.2g} s")
        if ours is not None:
            axes.axvline(ours / 1e3, color=LOOKS["ours"].color, linewidth=0.9, label=f"our bound, {ours / 1e3:.2g} s")
        axes.set_xscale("log")
        axes.set_xlim(2e-3, 60)
        axes.set_xlabel("end-to-end delay [s]")
    histogram.set_title("(a) histogram")
    histogram.set_ylabel("share of packets x targets, per class")
    cdf.set_title("(b) what has arrived by then")
    cdf.set_ylabel("share of packets x targets")
    cdf.set_ylim(0, 1.05)
    cdf.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    within, of_deliveries = _share_within(_WITHIN_S, of_all=True), _share_within(_WITHIN_S, of_all=False)
    means = {case: runs.per_seed("delay_ms.mean", case=case) for case in _CASES}
    tail = [1 - share for share in runs.per_seed(of_deliveries, case="flooding").values()]

    def shares(case: str, quantity: Quantity, what: str) -> Statement:
        return Statement(what, list(runs.per_seed(quantity, case=case).values()), "above", 0.5)

    return [
        Claim(
            11,
            "Flooding has the better mean delay.",
            [
                Statement(
                    "the paper's method minus flooding",
                    differences(means["paper"], means["flooding"]),
                    "above",
                    0.0,
                    "ms",
                )
            ],
        ),
        Claim(
            11,
            "Flooding's delays have a long tail.",
            [Statement("flooding: deliveries later than 0.5 s", tail, "above", _LONG)],
            "A flooded packet is relayed at once or lost: three in four are lost here, and what arrives is early. A "
            "tail needs queues that hold packets for seconds, which neither this MAC (500 ms) nor flooding has.",
        ),
        Claim(
            11,
            "With the proposed method most packets arrive within 0.5 s.",
            [
                shares("paper", of_deliveries, "the paper's method: deliveries within 0.5 s"),
                shares("paper", within, "the paper's method: packets x targets within 0.5 s"),
            ],
            "The paper's slot holds the packets of a period by their airtime on one link, but a flood takes the air of "
            "every relay: queues grow, and what leaves them collides.",
        ),
        Claim(
            11,
            "(Beyond the paper) With the timetable most packets arrive within 0.5 s.",
            [shares("ours", within, "fanet-mw: packets x targets within 0.5 s")],
            "Turns in which nothing collides carry the whole load, each packet with a bound known when it is accepted.",
        ),
    ]


FIGURE: Final = Recipe(
    "figure-11",
    "Delays of flooding, of the paper's method and of the timetable",
    "fig11",
    "44 sources, 1024 B every 0.1 s to everyone. The paper's method: 8 clusters, flooding period 0.5 s. Shares are of "
    "all packets x targets, so that a curve ends at the delivery ratio: what is lost has no delay.",
    draw,
    claims,
)
