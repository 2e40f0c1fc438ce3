"""Figure 11: the delays of flooding, of the paper's method, and of the timetable: means, tails, and
the limit of 0.5 s.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final

from fanet_mw.bounds.arrivals import Bounded
from fanet_mw.bounds.paper import cluster_estimate
from fanet_mw.units import S
from sim.figures.colors import DARK
from sim.figures.finished_runs import Quantity, Row, Runs, arrived, differences
from sim.figures.paper_claims import Claim, Reason, above, below, share_above, share_below
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.style import CONTROL, LOOKS, band, canvas, legend_above, look_of, plain_log
from sim.sweep.measures import DELAY_EDGES_S

_CASES: Final = ("flooding", CONTROL, "paper", "ours")
_VARIANTS: Final = {"paper": "the paper's method, 8 clusters", "ours": "fanet-mw: timetable, 4 s"}
_WITHIN_S: Final = 0.5
_LONG: Final = 0.01
_MOST: Final = 0.5
_NEARLY: Final = 0.9
_ALL: Final = 0.999
_STATED: Final = 0.99
_OFTEN: Final = 0.3
_PERIOD_S: Final = 0.5
_INTERVAL_S: Final = 0.1
_SOURCES: Final = 44
_CLUSTERS: Final = 8
_REST: Final = "ours, at rest"
_ALIKE: Final = 0.001
_NEARLY_ALIKE: Final = 0.01
_SLOWER_MS: Final = 50.0
_CLASSES: Final = 4
"""The number of classes of `delay_counts` that form one bar of the histogram."""


def paper_bound_s() -> float | None:
    """The paper's worst case for one cluster with the slot of its equations; None if they give no number."""
    found = cluster_estimate(
        airtime_ns=1,  # it does not matter with that slot
        slot_ns=None,
        period_ns=round(_PERIOD_S * S),
        interval_ns=round(_INTERVAL_S * S * _CLUSTERS / _SOURCES),
    )
    return found.delay_ns / S if isinstance(found, Bounded) else None


def _share_within(limit_s: float, *, of_all: bool) -> Callable[[Row], float | None]:
    """The share of deliveries within a limit: of all packets x targets, or of the deliveries."""
    last = next(number for number, edge in enumerate(DELAY_EDGES_S) if edge >= limit_s * 0.999)

    def share(row: Row) -> float | None:
        counts = row["delay_counts"]
        whole = row["wanted"] if of_all else sum(counts)
        return sum(counts[: last + 1]) / whole if whole else None

    return share


_OF_ALL: Final = _share_within(_WITHIN_S, of_all=True)
_OF_DELIVERIES: Final = _share_within(_WITHIN_S, of_all=False)


def _kept(row: Row) -> float | None:
    """The share that arrived within its bound, of packets x targets for which a bound was stated."""
    stated = row.get("bound.stated_share")  # a table has no such column if no run stated a bound
    return float(row["bound.within_share"] / stated) if stated else None


def draw(runs: Runs) -> Drawing:
    figure, (histogram, cdf) = canvas(2)
    data = []
    for case in _CASES:
        by_edge, look = arrived(runs, case), look_of(case, _VARIANTS)
        if not by_edge:
            continue
        means = [one.mean for one in by_edge]
        cdf.plot(DELAY_EDGES_S, means, color=look.color, linestyle=look.dash, label=look.label)
        band(cdf, look, DELAY_EDGES_S, by_edge)
        drawn = means[::_CLASSES]
        histogram.stairs(
            [later - earlier for earlier, later in pairwise([0.0, *drawn])], [0.0, *DELAY_EDGES_S[::_CLASSES]],
            color=look.color, linestyle=look.dash, label=look.label, linewidth=1.6,
        )  # fmt: skip
        data += [
            point(one, series=case, delay_s=edge, share=one.mean - before)
            for edge, one, before in zip(DELAY_EDGES_S, by_edge, [0.0, *means], strict=False)
        ]
    resting = arrived(runs, _REST)
    if resting:
        label = f"{_VARIANTS['ours']}, at rest"
        cdf.plot(DELAY_EDGES_S, [one.mean for one in resting], color=DARK, linestyle=":", linewidth=1, label=label)
    data += [point(one, series=_REST, delay_s=edge) for edge, one in zip(DELAY_EDGES_S, resting, strict=False)]
    paper, ours = paper_bound_s(), max(runs.per_seed("bound.worst_ms", case="ours").values(), default=None)
    for axes in (histogram, cdf):
        if paper is not None:
            axes.axvline(
                paper, color=LOOKS["paper"].color, linestyle=LOOKS["paper"].dash, linewidth=0.9,
                label=f"the paper's estimate, {paper:.2g} s",
            )  # fmt: skip
        if ours is not None:
            axes.axvline(ours / 1e3, color=LOOKS["ours"].color, linewidth=0.9, label=f"our bound, {ours / 1e3:.2g} s")
        axes.set_xscale("log")
        axes.set_xlim(2e-3, 20)
        plain_log(axes.xaxis)
        axes.set_xlabel("end-to-end delay [s]")
    histogram.set_title("(a) histogram")
    histogram.set_ylabel("share of packets x targets, per class")
    cdf.set_title("(b) what has arrived by then")
    cdf.set_ylabel("share of packets x targets")
    cdf.set_ylim(0, 1.05)
    legend_above(figure, cdf)
    return Drawing(figure, data)


def _flooding_is_faster_on_average(runs: Runs) -> Claim:
    def longer(quantity: str) -> list[float]:
        """The paper's method minus flooding, for each seed."""
        return differences(runs.per_seed(quantity, case="paper"), runs.per_seed(quantity, case="flooding"))

    slots = Reason(
        "A flooded packet is relayed at once; under the paper's method it waits for its head's slot first.",
        [above("wait at the origin, the paper's method minus flooding", longer("delay_parts_ms.queue"), 0.0, "ms")],
    )
    return Claim(
        11,
        "Flooding has the better mean delay.",
        [above("the paper's method minus flooding", longer("delay_ms.mean"), 0.0, "ms")],
        [slots],
    )


def _flooding_has_a_tail(runs: Runs) -> Claim:
    def flooded(quantity: Quantity) -> dict[int, float]:
        return runs.per_seed(quantity, case="flooding")

    losses = Reason(
        "Flooding loses packets, it does not delay them: a copy is relayed at once or collides. A tail needs queues "
        "that hold packets for seconds, and flooding has none.",
        [
            share_below("flooding: delivery ratio", flooded("pdr"), _MOST),
            below("flooding: longest delay", flooded("delay_ms.max"), _WITHIN_S * 1e3, "ms"),
            below("flooding: wait at the origin", flooded("delay_parts_ms.queue"), 1.0, "ms"),
        ],
    )
    tail = [1 - share for share in flooded(_OF_DELIVERIES).values()]
    return Claim(
        11,
        "Flooding's delays have a long tail.",
        [share_above("flooding: deliveries later than 0.5 s", tail, _LONG)],
        [losses],
    )


def _the_method_is_in_time(runs: Runs) -> Claim:
    def seen(quantity: Quantity, case: str = "paper") -> dict[int, float]:
        return runs.per_seed(quantity, case=case)

    overload = Reason(
        "Most packets do not arrive at all: the slot holds a period's packets by their airtime on one link, but each "
        "flood takes the air of every relay. At a tenth of the load the claim is true.",
        [
            share_below("the paper's method: delivery ratio", seen("pdr"), _MOST),
            share_above("every 1 s: packets x targets within 0.5 s", seen(_OF_ALL, "paper, every 1 s"), _MOST),
        ],
    )
    all_heads = "paper, 44 clusters"
    unicast = Reason(
        "What arrives late is late on its way to a head, by unicast through air that floods keep busy: where every "
        "node is a head nearly all that arrives does so in time, though no more arrives.",
        [
            share_above("44 clusters: deliveries within 0.5 s", seen(_OF_DELIVERIES, all_heads), _NEARLY),
            share_below("44 clusters: delivery ratio", seen("pdr", all_heads), _MOST),
            share_above("share of unicast frames that fail", seen("air.attempt_failure"), _OFTEN),
        ],
    )
    return Claim(
        11,
        "With the proposed method most packets arrive within 0.5 s.",
        [
            share_above("the paper's method: deliveries within 0.5 s", seen(_OF_DELIVERIES), _MOST),
            share_above("the paper's method: packets x targets within 0.5 s", seen(_OF_ALL), _MOST),
        ],
        [overload, unicast],
    )


def _the_timetable_is_in_time(runs: Runs) -> Claim:
    def ours(quantity: Quantity) -> dict[int, float]:
        return runs.per_seed(quantity, case="ours")

    turns = Reason(
        "Turns in which nothing collides carry the whole load, each packet within the bound that was stated when it "
        "was accepted.",
        [
            share_above("fanet-mw: delivery ratio", ours("pdr"), _ALL),
            share_above("fanet-mw: packets x targets with a bound", ours("bound.stated_share"), _STATED),
            share_above("fanet-mw: of these within their bound", ours(_kept), _ALL),
        ],
        "the limit of 0.99.",
    )
    return Claim(
        0,
        "With the timetable most packets arrive within 0.5 s.",
        [share_above("fanet-mw: packets x targets within 0.5 s", ours(_OF_ALL), _MOST)],
        [turns],
    )


def _motion_does_not_matter(runs: Runs) -> Claim:
    def lost(quantity: Quantity) -> list[float]:
        """What the timetable loses by flying, for each seed."""
        return differences(runs.per_seed(quantity, case=_REST), runs.per_seed(quantity, case="ours"))

    later_ms = [-later for later in lost("delay_ms.p95")]
    return Claim(
        0,
        "A timetable serves a formation that flies as well as one at rest.",
        [
            below("delivery ratio at rest minus that at 7.5 m/s", lost("pdr"), _ALIKE),
            below("within the bound at rest minus that at 7.5 m/s", lost("bound.within_share"), _NEARLY_ALIKE),
            below("95 % of delays at 7.5 m/s minus those at rest", later_ms, _SLOWER_MS, "ms"),
        ],
    )


def _the_window_is_not_why(runs: Runs) -> Claim:
    return Claim(
        0,
        "Flooding with the timetable's contention window (cw_min 1) delivers less than half, as with its own (31).",
        [
            share_below("flooding, cw_min 1: delivery ratio", runs.per_seed("pdr", case=CONTROL), _MOST),
            share_below("flooding, cw_min 31: delivery ratio", runs.per_seed("pdr", case="flooding"), _MOST),
        ],
    )


_CLAIMS: Final = (
    _flooding_is_faster_on_average, _flooding_has_a_tail, _the_method_is_in_time, _the_timetable_is_in_time,
    _motion_does_not_matter, _the_window_is_not_why,
)  # fmt: skip


def claims(runs: Runs) -> list[Claim]:
    return [claim(runs) for claim in _CLAIMS]


FIGURE: Final = Recipe(
    "figure-11",
    "Delays of flooding, of the paper's method and of the timetable",
    "fig11",
    "44 sources, 1024 B every 0.1 s to everyone, in formation at 7.5 m/s. fanet-mw: its timetable, every node a head, "
    "period 4 s. The paper's method: 8 clusters, flooding period 0.5 s; its estimate is equation (3) for one cluster. "
    "The MAC's contention window (radio.cw_min) is 31 slots, that of 802.11 DSSS, but 1 for fanet-mw, whose turns need "
    "no random backoff and are shorter without it; flooding with 1 too is the control. Our bound is the greatest that "
    "a packet's origin stated. Shares are of all packets x targets, so that a curve ends at the delivery ratio: what "
    "is lost has no delay. Bands: 95 % of the mean.",
    draw,
    claims,
)
