"""Beyond the paper: fanet-mw and its rivals over the load that is offered."""

from typing import Final

from sim.figures.curves import P95, PAPERS, PDR, Panel, curves
from sim.figures.finished_runs import Row, Runs, differences, max_per_seed
from sim.figures.paper_claims import Claim, above
from sim.figures.recipe import Recipe
from sim.figures.style import CONTROL

_RIVALS: Final = ("paper", "flooding", CONTROL, "gossip", "counter")


def _ms_per_delivery(row: Row) -> float | None:
    """The busy time of the channel at a mean station, per packet delivered to it [ms]."""
    per_node = row["delivered"] / row["nodes"]
    return row["air.busy"] * row["duration_s"] * 1e3 / per_node if per_node else None


def claims(runs: Runs) -> list[Claim]:
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


FIGURE: Final = Recipe(
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
    claims,
)
