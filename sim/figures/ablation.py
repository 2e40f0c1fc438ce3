"""Beyond the paper: what each mechanism of fanet-mw adds, one after the other."""

import math
from collections.abc import Sequence
from typing import Final

from sim.figures.finished_runs import Quantity, Runs, differences
from sim.figures.paper_claims import NEARLY_ALL, Claim, Reason, Statement, above, below, share_above
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.style import SERIES, Look, canvas, legend_above, reaches

_URGENT_P95: Final = "classes.urgent.delay_ms.p95"
_CLASSES_OF_LOAD: Final = (
    SERIES[0]._replace(label="the load"),
    SERIES[4]._replace(label="urgent packets"),
)
_ALL_PACKETS: Final = Look("all packets", "#888888", "", "-")
_PANELS: Final[Sequence[tuple[str, Sequence[str], float]]] = (
    ("packet delivery ratio", ("pdr", "classes.urgent.pdr"), 1.0),
    ("95th percentile of the delay [s]", ("delay_ms.p95", _URGENT_P95), 1e-3),
    ("share of time the air is busy", ("air.busy",), 1.0),
)
"""The label of each panel, its quantities (for the load, for urgent packets), and the factor for its unit."""


def draw(runs: Runs) -> Drawing:
    figure, panels = canvas(3, height=3.8, width=3.8, share_y=True)
    cases = list(dict.fromkeys(row["case"] for row in runs.rows))
    data = []
    for axes, (label, quantities, factor) in zip(panels, _PANELS, strict=True):
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
            for one, case in zip(found, cases, strict=True):
                data.append(point(one, panel=label, packets=look.label, mechanism=case))
        axes.set_xlabel(label)
        axes.grid(visible=False, axis="y")
        axes.set_xlim(left=0)
    panels[0].set_yticks(range(len(cases)), cases)
    panels[0].set_xlim(0, 1.05)
    panels[0].invert_yaxis()
    legend_above(figure, panels[0])
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    def change(quantity: Quantity, case: str, before: str) -> list[float]:
        return differences(runs.per_seed(quantity, case=case), runs.per_seed(quantity, case=before))

    def said(text: str, *statements: Statement, reasons: Sequence[Reason] = ()) -> Claim:
        return Claim(0, text, statements, reasons)

    spread = change("pdr", "+ spread over the slot", "+ 8 clusters with slots")
    at_once = Reason(
        "A head lets its queue out at once, and the copies of one packet collide with those of the next: the same "
        "packets in the same slots arrive when they are spread.",
        [above("PDR, spread minus at once", spread, 0.0)],
    )
    urgent_ms = change(_URGENT_P95, "+ priorities", "+ fewer relays")
    return [
        said(
            "Slots of clusters deliver more than plain flooding.",
            above("PDR", change("pdr", "+ 8 clusters with slots", "plain flooding"), 0.0),
            reasons=[at_once],
        ),
        said("Letting packets out evenly over the slot delivers more.", above("PDR", spread, 0.0)),
        said(
            "Fewer relays leave the air free.",
            below("busy share", change("air.busy", "+ fewer relays", "+ spread over the slot"), 0.0),
        ),
        said("Priorities make urgent packets faster.", below("urgent, 95th percentile", urgent_ms, 0.0, "ms")),
        said("Aggregation saves air.", below("busy share", change("air.busy", "+ aggregation", "+ priorities"), 0.0)),
        said("Repair delivers all.", share_above("PDR", runs.per_seed("pdr", case="+ repair"), NEARLY_ALL)),
        said(
            "A timetable delivers all in less time, in less air.",
            share_above("PDR", runs.per_seed("pdr", case="timetable instead"), NEARLY_ALL),
            below("95th percentile", change("delay_ms.p95", "timetable instead", "+ repair"), 0.0, "ms"),
            below("busy share", change("air.busy", "timetable instead", "+ repair"), 0.0),
        ),
    ]


FIGURE: Final = Recipe(
    "ablation",
    "What each mechanism adds",
    "ablation",
    "44 sources to everyone: 256 B every 0.3 s, and 128 B every 1 s that are urgent. Each row adds a mechanism to the "
    "one above, flooding period 1 s; the last replaces contention among relays by a timetable, in which all nodes are "
    "heads, packets have one priority, and radio.cw_min is 7 instead of 31. Lines: 95 % of the mean.",
    draw,
    claims,
)
