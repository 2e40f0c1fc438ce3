"""Figure 10: the paper's method against clusters and flooding period. Claims: what is best, what is too often."""

from collections.abc import Mapping, Sequence
from typing import Final

from sim.figures.claims import Claim, Reason, above
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.runs import Runs, best, differences, pooled
from sim.figures.style import SERIES, beside, canvas, legend_above, line, ticks_at

_MANY: Final = 22
_SELDOM_S: Final = 1.0
_LOW: Final = 0.05
_APART: Final = 0.04
"""The marks of two lines at one number of clusters stand so far apart, as a share of it."""
_PACES: Final = {"burst": "at once (the paper)", "spread": "over the slot (default)"}


def _pdr(runs: Runs, case: str, clusters: int, period_s: float, interval_s: float) -> Mapping[int, float]:
    return runs.per_seed(
        "pdr",
        case=case,
        clusters__count=clusters,
        clusters__flooding_period_s=period_s,
        traffic__interval_s=interval_s,
    )


def draw(runs: Runs) -> Drawing:
    intervals = list(reversed(runs.levels("traffic.interval_s")))
    figure, panels = canvas(len(intervals), len(_PACES), height=2.9)
    data = []
    clusters = runs.levels("clusters.count")
    for number, (case, interval_s) in enumerate((case, at) for case in _PACES for at in intervals):
        axes = panels[number]
        periods = runs.levels("clusters.flooding_period_s")
        for place, (look, period_s) in enumerate(zip(SERIES, periods, strict=False)):
            found = [
                runs.of(
                    "pdr",
                    case=case,
                    clusters__count=count,
                    clusters__flooding_period_s=period_s,
                    traffic__interval_s=interval_s,
                )
                for count in clusters
            ]
            xs = [beside(count, place, len(periods), log=True, apart=_APART) for count in clusters]
            line(axes, look._replace(label=f"flooding period {period_s:g} s"), xs, found, most=1.0)
            data += [
                point(one, pacing=case, interval_s=interval_s, flooding_period_s=period_s, clusters=count)
                for one, count in zip(found, clusters, strict=True)
            ]
        axes.set_title(f"({'abcd'[number]}) a packet every {interval_s:g} s, {_PACES[case]}")
        axes.set_xscale("log", base=2)
        ticks_at(axes.xaxis, {count: str(count) for count in clusters})
        axes.set_xlabel("clusters")
        axes.set_ylabel("packet delivery ratio")
        axes.set_ylim(0, 1.05)
    legend_above(figure, panels[0])
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    return [*_best(runs), *_too_often(runs)]


def _over_periods(runs: Runs, case: str, clusters: int, interval_s: float) -> Mapping[int, float]:
    """The PDR of each seed, its mean over all flooding periods."""
    periods = runs.levels("clusters.flooding_period_s")
    return pooled(*(_pdr(runs, case, clusters, period_s, interval_s) for period_s in periods))


def _best(runs: Runs) -> list[Claim]:
    clusters = runs.levels("clusters.count")
    intervals = list(reversed(runs.levels("traffic.interval_s")))
    few_of, many_of = ([count for count in clusters if (count >= _MANY) == wanted] for wanted in (False, True))

    def lead(case: str, interval_s: float) -> dict[int, float]:
        """The best PDR of many clusters minus the best of few."""
        over = {count: _over_periods(runs, case, count, interval_s) for count in clusters}
        many, few = best(*(over[count] for count in many_of)), best(*(over[count] for count in few_of))
        return {seed: many[seed] - few[seed] for seed in many}

    def spreading_gains(counts: Sequence[int], interval_s: float) -> list[float]:
        spread, burst = (
            pooled(*(_over_periods(runs, case, count, interval_s) for count in counts)) for case in ("spread", "burst")
        )
        return differences(spread, burst)

    bursts = Reason(
        "A head that lets out all it has as soon as its slot begins floods a burst, in which the copies of one "
        "packet collide with those of the next. Few clusters have long queues and so long bursts; the same packets "
        "arrive when they are spread over the same slots.",
        [
            above(
                f"every {interval_s:g} s, fewer than {_MANY} clusters: PDR by spreading minus by bursts",
                spreading_gains(few_of, interval_s),
                0.0,
            )
            for interval_s in intervals
        ],
    )
    gone = Reason(
        "Spread over its slot a queue is no burst, and what clusters gained is gone.",
        [
            above(
                f"every {interval_s:g} s: lead of many clusters by bursts minus by spreading",
                differences(lead("burst", interval_s), lead("spread", interval_s)),
                0.0,
            )
            for interval_s in intervals
        ],
    )
    return [
        Claim(
            10,
            f"The PDR is best at 22 or 44 clusters. (Packets let out {pace}.)",
            [
                above(
                    f"every {interval_s:g} s: best of {_MANY} or more clusters minus best of fewer, all periods",
                    lead(case, interval_s),
                    0.0,
                )
                for interval_s in intervals
            ],
            [bursts if case == "burst" else gone],
        )
        for case, pace in _PACES.items()
    ]


def _too_often(runs: Runs) -> list[Claim]:
    clusters, periods = runs.levels("clusters.count"), runs.levels("clusters.flooding_period_s")
    intervals = list(reversed(runs.levels("traffic.interval_s")))
    often_s, most = periods[0], clusters[-1]
    slot_ms = often_s * 1e3 / most

    def seldom_minus_often(case: str, counts: Sequence[int], interval_s: float) -> dict[int, float]:
        often, seldom = (
            pooled(
                *(
                    _pdr(runs, case, count, period_s, interval_s)
                    for count in counts
                    for period_s in periods
                    if (period_s < _SELDOM_S) == wanted
                )
            )
            for wanted in (True, False)
        )
        return {seed: seldom[seed] - often[seed] for seed in seldom}

    few = [count for count in clusters if count < _MANY]
    bursts = Reason(
        "The longer the period, the more packets a head has when its slot begins, and the longer its burst: what "
        "flooding seldom takes is given back when the same packets are spread over the same slots.",
        [
            above(
                f"every {interval_s:g} s, fewer than {_MANY} clusters: PDR gained by flooding seldom, spreading minus "
                "bursts",
                differences(
                    seldom_minus_often("spread", few, interval_s), seldom_minus_often("burst", few, interval_s)
                ),
                0.0,
            )
            for interval_s in intervals
        ],
    )
    meet = Reason(
        f"Without bursts it is too often: {most} slots in {often_s:g} s are {slot_ms:.3g} ms each, shorter than a "
        "flood lasts, so that floods of heads that follow each other meet.",
        [
            above(
                f"every {intervals[0]:g} s, {most} clusters, spreading: PDR with 1 s and more minus with less",
                seldom_minus_often("spread", [most], intervals[0]),
                0.0,
            ),
            above(
                f"every {intervals[0]:g} s, {most} clusters, spreading: mean time of a packet on the air",
                runs.per_seed(
                    "delay_parts_ms.air",
                    case="spread",
                    clusters__count=most,
                    clusters__flooding_period_s=often_s,
                    traffic__interval_s=intervals[0],
                ),
                slot_ms,
                "ms",
            ),
        ],
    )
    return [
        Claim(
            10,
            "The PDR is low when clusters flood more often than every second.",
            [
                above(
                    f"every {interval_s:g} s: PDR with periods of 1 s and more minus with less, mean of all clusters",
                    seldom_minus_often("burst", clusters, interval_s),
                    _LOW,
                )
                for interval_s in intervals
            ],
            [bursts, meet],
        )
    ]


FIGURE: Final = Recipe(
    "figure-10",
    "The paper's method against clusters, flooding period and load",
    "fig10",
    "44 sources, 1024 B to everyone, relays by all. Upper row: a head lets out all that it has as soon as its slot "
    "begins (the paper's rule, clusters.pacing = burst). Lower row: evenly over its slot (the default).",
    draw,
    claims,
)
