"""Beyond the paper: the age of the positions that UAVs have of each other, over how often they send them."""

from typing import Final

from sim.figures.curves import PAPERS, PDR, Panel, curves
from sim.figures.finished_runs import Runs, differences, max_per_seed
from sim.figures.paper_claims import Claim, above
from sim.figures.recipe import Recipe


def claims(runs: Runs) -> list[Claim]:
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


FIGURE: Final = Recipe(
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
    claims,
)
