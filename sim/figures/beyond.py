"""Figures beyond the paper: load, swarm size, clock errors, age of information, and an ablation of the mechanisms."""

import math
from collections.abc import Sequence
from typing import Final

from sim.figures.claims import Claim, Reason, Statement, above, below
from sim.figures.curves import Panel, curves
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.runs import Quantity, Row, Runs, differences, max_per_seed
from sim.figures.statistics import SHARE
from sim.figures.style import CONTROL, SERIES, Look, canvas, legend_above, reaches

_URGENT_P95: Final = "classes.urgent.delay_ms.p95"
_CLASSES_OF_LOAD: Final = (
    SERIES[0]._replace(label="the load"),
    SERIES[4]._replace(label="urgent packets"),
)
_ALL_PACKETS: Final = Look("all packets", "#888888", "", "-")
_ABLATION_PANELS: Final[Sequence[tuple[str, Sequence[str], float]]] = (
    ("packet delivery ratio", ("pdr", "classes.urgent.pdr"), 1.0),
    ("95th percentile of the delay [s]", ("delay_ms.p95", _URGENT_P95), 1e-3),
    ("share of time the air is busy", ("air.busy",), 1.0),
)
"""The label of each panel, its quantities (for the load, for urgent packets), and the factor for its unit."""
_RIVALS: Final = ("paper", "flooding", CONTROL, "gossip", "counter")
_PAPERS: Final = "the paper's method, 8 clusters, 0.5 s"
_ALL: Final = 0.99


def _ms_per_delivery(row: Row) -> float | None:
    """The busy time of the channel at a mean station, per packet delivered to it [ms]."""
    per_node = row["delivered"] / row["nodes"]
    return row["air.busy"] * row["duration_s"] * 1e3 / per_node if per_node else None


def _frames_per_packet(row: Row) -> float | None:
    """Frames on the air for each packet that was sent."""
    return row["frames.sent"] / row["generated"] if row["generated"] else None


_PDR: Final = Panel("pdr", "packet delivery ratio", share=True)
_P95: Final = Panel("delay_ms.p95", "95th percentile of the delay [s]", log=True, factor=1e-3)


def claims_load(runs: Runs) -> list[Claim]:
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


def claims_size(runs: Runs) -> list[Claim]:
    largest = runs.levels("nodes.count")[-1]
    arrives = above(
        f"{largest} nodes: PDR of fanet-mw",
        runs.per_seed("pdr", case="ours", nodes__count=largest),
        _ALL,
        possible=SHARE,
    )
    return [Claim(0, "Claimed slots deliver at every size.", [arrives])]


def claims_clocks(runs: Runs) -> list[Claim]:
    worst = runs.levels("clock.offset_ms")[-1]

    def at_worst(case: str) -> dict[int, float]:
        return runs.per_seed("pdr", case=case, clock__offset_ms=worst)

    return [
        Claim(
            0,
            f"With clocks that are wrong by up to {worst:g} ms the timetable delivers all, once hellos carry the time.",
            [
                above(
                    "hellos carry the time: PDR", at_worst("slack 150 us, hellos carry the time"), _ALL, possible=SHARE
                )
            ],
            [
                Reason(
                    "It is the common time that does so: without it turns meet, and packets are lost.",
                    [
                        below("slack 50 us: PDR", at_worst("slack 50 us"), _ALL, possible=SHARE),
                        above(
                            "hellos carry the time minus slack 50 us: PDR",
                            differences(at_worst("slack 150 us, hellos carry the time"), at_worst("slack 50 us")),
                            0.0,
                        ),
                    ],
                )
            ],
        )
    ]


def claims_age(runs: Runs) -> list[Claim]:
    def youngest(case: str) -> dict[int, float]:
        """The least age over all intervals, for each seed."""
        levels = runs.levels("traffic.interval_s")
        negative = [runs.per_seed(lambda row: -row["age_s"], case=case, traffic__interval_s=at) for at in levels]
        return {seed: -age for seed, age in max_per_seed(*negative).items()}

    return [
        Claim(
            0,
            "At its best interval each method's positions are older than the timetable's.",
            [
                above(
                    f"{case}: least age minus the timetable's", differences(youngest(case), youngest("ours")), 0.0, "s"
                )
                for case in ("flooding", "paper")
            ],
        )
    ]


def draw_ablation(runs: Runs) -> Drawing:
    figure, panels = canvas(3, height=3.8, width=3.8, share_y=True)
    cases = list(dict.fromkeys(row["case"] for row in runs.rows))
    data = []
    for axes, (label, quantities, factor) in zip(panels, _ABLATION_PANELS, strict=True):
        looks = _CLASSES_OF_LOAD if len(quantities) > 1 else (_ALL_PACKETS,)
        for number, (quantity, look) in enumerate(zip(quantities, looks, strict=True)):
            found = [runs.of(quantity, case=case).scaled(factor) for case in cases]
            reach = reaches(found, most=1.0 if factor == 1.0 else math.inf)
            height = 0.7 / len(quantities)
            at = [place + (number - (len(quantities) - 1) / 2) * height for place in range(len(cases))]
            axes.barh(
                at, [one.mean for one in found], xerr=reach, height=height, color=look.color, label=look.label,
                error_kw={"elinewidth": 1.0},
            )  # fmt: skip
            data += [
                point(one, panel=label, packets=look.label, mechanism=case)
                for one, case in zip(found, cases, strict=True)
            ]
        axes.set_xlabel(label)
        axes.grid(visible=False, axis="y")
        axes.set_xlim(left=0)
    panels[0].set_yticks(range(len(cases)), cases)
    panels[0].set_xlim(0, 1.05)
    panels[0].invert_yaxis()
    legend_above(figure, panels[0])
    return Drawing(figure, data)


def claims_ablation(runs: Runs) -> list[Claim]:
    def change(quantity: Quantity, case: str, before: str) -> list[float]:
        return differences(runs.per_seed(quantity, case=case), runs.per_seed(quantity, case=before))

    def said(text: str, *statements: Statement, reasons: Sequence[Reason] = ()) -> Claim:
        return Claim(0, text, statements, reasons)

    spread = change("pdr", "+ spread over the slot", "+ 8 clusters with slots")
    repaired, table = runs.per_seed("pdr", case="+ repair"), runs.per_seed("pdr", case="timetable instead")
    return [
        said(
            "Slots of clusters deliver more than plain flooding.",
            above("PDR", change("pdr", "+ 8 clusters with slots", "plain flooding"), 0.0),
            reasons=[
                Reason(
                    "A head lets its queue out at once, and the copies of one packet collide with those of the next: "
                    "the same packets in the same slots arrive when they are spread.",
                    [above("PDR, spread minus at once", spread, 0.0)],
                )
            ],
        ),
        said(
            "Letting packets out evenly over the slot delivers more.",
            above("PDR", spread, 0.0),
        ),
        said(
            "Fewer relays leave the air free.",
            below("busy share", change("air.busy", "+ fewer relays", "+ spread over the slot"), 0.0),
        ),
        said(
            "Priorities make urgent packets faster.",
            below("urgent, 95th percentile", change(_URGENT_P95, "+ priorities", "+ fewer relays"), 0.0, "ms"),
        ),
        said(
            "Aggregation saves air.",
            below("busy share", change("air.busy", "+ aggregation", "+ priorities"), 0.0),
        ),
        said(
            "Repair delivers all.",
            above("PDR", repaired, _ALL, possible=SHARE),
        ),
        said(
            "A timetable delivers all in less time, in less air.",
            above("PDR", table, _ALL, possible=SHARE),
            below("95th percentile", change("delay_ms.p95", "timetable instead", "+ repair"), 0.0, "ms"),
            below("busy share", change("air.busy", "timetable instead", "+ repair"), 0.0),
        ),
    ]


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
        [_PDR, _P95, Panel(_ms_per_delivery, "busy air per delivered packet [ms]", log=True)],
        value=lambda interval_s: 44 / interval_s,
        variants={"ours": "fanet-mw: timetable, 4 s", "paper": _PAPERS},
    ),
    claims_load,
)
SIZE: Final = Recipe(
    "size",
    "45 to 1,000 nodes",
    "size",
    "Grids of the paper's density, ten sources of 256 B a second to everyone. fanet-mw: slots that are claimed within "
    "two hops. Frames: all of the run, hellos too; fanet-mw needs those of the time before anyone sends.",
    curves(
        "nodes.count",
        "nodes",
        [
            Panel("pdr", "packet delivery ratio (from 0.9)", share=True, least=0.9),
            _P95,
            Panel(_frames_per_packet, "frames on the air per packet", log=True),
        ],
        variants={"ours": "fanet-mw: claimed slots"},
    ),
    claims_size,
)
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
        [_PDR, Panel("delay_ms.p95", "95th percentile of the delay [s]", factor=1e-3)],
        linear=True,
    ),
    claims_clocks,
)
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
        [Panel("age_s", "mean age of information [s]", log=True), _PDR],
        variants={"ours": "fanet-mw: timetable, 0.5 s", "paper": _PAPERS},
    ),
    claims_age,
)
ABLATION: Final = Recipe(
    "ablation",
    "What each mechanism adds",
    "ablation",
    "44 sources to everyone: 256 B every 0.3 s, and 128 B every 1 s that are urgent. Each row adds a mechanism to the "
    "one above, flooding period 1 s; the last replaces contention among relays by a timetable, in which all nodes are "
    "heads, packets have one priority, and radio.cw_min is 7 instead of 31. Lines: 95 % of the mean.",
    draw_ablation,
    claims_ablation,
)
