"""Figure 10: the paper's method with different numbers of clusters and flooding periods."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Final

from sim.figures.finished_runs import Runs, differences, max_per_seed, mean_per_seed
from sim.figures.paper_claims import Claim, Reason, Statement, above, alike
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.style import SERIES, beside, canvas, crosses, legend_above, line, ticks_at

_MANY: Final = 22
_SELDOM_S: Final = 1.0
_LOW: Final = 0.05
_APART: Final = 0.04
"""The distance of the marks of two lines at the same number of clusters, as a share of it."""
_ALIKE: Final = 0.02
_REST: Final = ", at rest"
_PACES: Final = {"burst": "at once (the paper)", "spread": "over the slot (default)"}


def _seen(
    runs: Runs, quantity: str, case: str, clusters: int, period_s: float, interval_s: float
) -> Mapping[int, float]:
    at = {"clusters__flooding_period_s": period_s, "traffic__interval_s": interval_s}
    return runs.per_seed(quantity, case=case, clusters__count=clusters, **at)


def draw(runs: Runs) -> Drawing:
    intervals = _intervals(runs)
    figure, panels = canvas(len(intervals), len(_PACES), height=2.9)
    data = []
    clusters = runs.levels("clusters.count")
    for number, (case, interval_s) in enumerate((case, at) for case in _PACES for at in intervals):
        axes = panels[number]
        periods = runs.levels("clusters.flooding_period_s")
        for place, (look, period_s) in enumerate(zip(SERIES, periods, strict=False)):
            at = {"clusters__flooding_period_s": period_s, "traffic__interval_s": interval_s}
            found = [runs.of("pdr", case=case, clusters__count=count, **at) for count in clusters]
            xs = [beside(count, place, len(periods), log=True, apart=_APART) for count in clusters]
            line(axes, look._replace(label=f"flooding period {period_s:g} s"), xs, found, most=1.0)
            at_rest = {"case": case + _REST, **at}
            levels = runs.levels("clusters.count", **at_rest)
            rest = {count: runs.of("pdr", clusters__count=count, **at_rest) for count in levels}
            crosses(
                axes, look,
                [(beside(k, place, len(periods), log=True, apart=_APART), one.mean) for k, one in rest.items()],
            )  # fmt: skip
            for motion, drawn in (("at rest", rest), ("formation", dict(zip(clusters, found, strict=True)))):
                where = {"pacing": case, "motion": motion, "interval_s": interval_s, "flooding_period_s": period_s}
                data += [point(one, **where, clusters=count) for count, one in drawn.items()]
        axes.set_title(f"({'abcd'[number]}) a packet every {interval_s:g} s, {_PACES[case]}")
        axes.set_xscale("log", base=2)
        ticks_at(axes.xaxis, {count: str(count) for count in clusters})
        axes.set_xlabel("clusters")
        axes.set_ylabel("packet delivery ratio")
        axes.set_ylim(0, 1.05)
    legend_above(figure, panels[0])
    return Drawing(figure, data)


def _intervals(runs: Runs) -> list[float]:
    return list(reversed(runs.levels("traffic.interval_s")))


def _few(runs: Runs) -> list[int]:
    """The numbers of clusters that are worse by the claim."""
    return [count for count in runs.levels("clusters.count") if count < _MANY]


def _many(runs: Runs) -> list[int]:
    """The numbers of clusters that are best by the claim."""
    return [count for count in runs.levels("clusters.count") if count >= _MANY]


def _over_periods(runs: Runs, case: str, clusters: int, interval_s: float) -> Mapping[int, float]:
    periods = runs.levels("clusters.flooding_period_s")
    return mean_per_seed(*(_seen(runs, "pdr", case, clusters, period_s, interval_s) for period_s in periods))


def _lead_of_many(runs: Runs, case: str, interval_s: float) -> dict[int, float]:
    """The best PDR with many clusters minus the best with few, for each seed."""
    many, few = (
        max_per_seed(*(_over_periods(runs, case, count, interval_s) for count in counts))
        for counts in (_many(runs), _few(runs))
    )
    return {seed: many[seed] - few[seed] for seed in many}


def _gain_of_spreading(runs: Runs, counts: Sequence[int], interval_s: float) -> list[float]:
    """The PDR if packets are spread over the slot minus the PDR if they are sent at once, for each seed."""
    spread, burst = (
        mean_per_seed(*(_over_periods(runs, case, count, interval_s) for count in counts))
        for case in ("spread", "burst")
    )
    return differences(spread, burst)


def _gain_of_flooding_seldom(runs: Runs, case: str, counts: Sequence[int], interval_s: float) -> dict[int, float]:
    """The PDR with periods of a second and more minus that with shorter ones, for each seed."""
    periods = runs.levels("clusters.flooding_period_s")
    seldom, often = (
        mean_per_seed(
            *(_seen(runs, "pdr", case, count, period_s, interval_s) for count in counts for period_s in chosen)
        )
        for chosen in (
            [period_s for period_s in periods if period_s >= _SELDOM_S],
            [period_s for period_s in periods if period_s < _SELDOM_S],
        )
    )
    return {seed: seldom[seed] - often[seed] for seed in seldom}


def _each(
    runs: Runs, what: str, values: Callable[[float], Mapping[int, float] | list[float]], limit: float = 0.0
) -> list[Statement]:
    """A statement for each generation interval, the longest first."""
    return [above(f"every {at:g} s{what}", values(at), limit) for at in _intervals(runs)]


def _bursts_collide(runs: Runs) -> Reason:
    return Reason(
        "A head that lets out all it has as soon as its slot begins floods a burst, in which the copies of one "
        "packet collide with those of the next. Few clusters have long queues and so long bursts; the same packets "
        "arrive when they are spread over the same slots.",
        _each(
            runs,
            f", fewer than {_MANY} clusters: PDR by spreading minus by bursts",
            lambda interval_s: _gain_of_spreading(runs, _few(runs), interval_s),
        ),
    )


def _spreading_levels(runs: Runs) -> Reason:
    return Reason(
        "Spread over its slot a queue is no burst, and what clusters gained is gone.",
        _each(
            runs,
            ": lead of many clusters by bursts minus by spreading",
            lambda at: differences(_lead_of_many(runs, "burst", at), _lead_of_many(runs, "spread", at)),
        ),
    )


def _many_are_best(runs: Runs, case: str, reason: Reason) -> Claim:
    return Claim(
        10,
        f"The PDR is best at 22 or 44 clusters. (Packets let out {_PACES[case]}.)",
        _each(
            runs,
            f": best of {_MANY} or more clusters minus best of fewer, all periods",
            lambda interval_s: _lead_of_many(runs, case, interval_s),
        ),
        [reason],
    )


def _seldom_is_long_bursts(runs: Runs) -> Reason:
    def gain(pacing: str, interval_s: float) -> dict[int, float]:
        return _gain_of_flooding_seldom(runs, pacing, _few(runs), interval_s)

    return Reason(
        "The longer the period, the more packets a head has when its slot begins, and the longer its burst: what "
        "flooding seldom takes is given back when the same packets are spread over the same slots.",
        _each(
            runs,
            f", fewer than {_MANY} clusters: PDR gained by flooding seldom, spreading minus bursts",
            lambda interval_s: differences(gain("spread", interval_s), gain("burst", interval_s)),
        ),
    )


def _short_slots_meet(runs: Runs) -> Reason:
    most, often_s, interval_s = _many(runs)[-1], runs.levels("clusters.flooding_period_s")[0], _intervals(runs)[0]
    slot_ms = often_s * 1e3 / most
    on_the_air_ms = _seen(runs, "delay_parts_ms.air", "spread", most, often_s, interval_s)
    seldom = _gain_of_flooding_seldom(runs, "spread", [most], interval_s)
    where = f"every {interval_s:g} s, {most} clusters, spreading"
    return Reason(
        f"Without bursts it is too often: {most} slots in {often_s:g} s are {slot_ms:.3g} ms each, shorter than a "
        "flood lasts, so that floods of heads that follow each other meet.",
        [
            above(f"{where}: PDR with 1 s and more minus with less", seldom, 0.0),
            above(f"{where}: mean time from a packet's first frame to its receipt", on_the_air_ms, slot_ms, "ms"),
        ],
    )


def _too_often_is_low(runs: Runs) -> Claim:
    counts = runs.levels("clusters.count")
    return Claim(
        10,
        "The PDR is low when clusters flood more often than every second.",
        _each(
            runs,
            ": PDR with periods of 1 s and more minus with less, mean of all clusters",
            lambda interval_s: _gain_of_flooding_seldom(runs, "burst", counts, interval_s),
            _LOW,
        ),
        [_seldom_is_long_bursts(runs), _short_slots_meet(runs)],
    )


def _as_at_rest(runs: Runs) -> Claim:
    differ = []
    keys = ("traffic.interval_s", "clusters.flooding_period_s", "clusters.count")
    for case in _PACES:
        at_rest = {"case": case + _REST}
        for interval_s, period_s, count in product(*(runs.levels(key, **at_rest) for key in keys)):
            moving, rest = (_seen(runs, "pdr", name, count, period_s, interval_s) for name in (case, case + _REST))
            differ += alike(
                f"{_PACES[case]}, {count} clusters, {period_s:g} s: PDR in formation minus at rest",
                differences(moving, rest),
                _ALIKE,
            )
    return Claim(0, "The paper's method delivers in a formation at 7.5 m/s what it delivers at rest.", differ)


def claims(runs: Runs) -> list[Claim]:
    return [
        _many_are_best(runs, "burst", _bursts_collide(runs)),
        _many_are_best(runs, "spread", _spreading_levels(runs)),
        _too_often_is_low(runs),
        _as_at_rest(runs),
    ]


FIGURE: Final = Recipe(
    "figure-10",
    "The paper's method against clusters, flooding period and load",
    "fig10",
    "44 sources, 1024 B to everyone, relays by all. Upper row: a head lets out all that it has as soon as its slot "
    "begins (the paper's rule, clusters.pacing = burst). Lower row: evenly over its slot (the default). "
    "In formation at 7.5 m/s (lines), some settings at rest (crosses).",
    draw,
    claims,
)
