"""Figure 9: plain flooding with different numbers of sources. The paper claims that the PDR falls because frames
collide.
"""

from typing import Final

from sim.figures.finished_runs import Row, Runs, differences
from sim.figures.paper_claims import Claim, Statement
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.statistics import SHARE
from sim.figures.style import SERIES, canvas, legend_above, line, spaced, ticks_at

_FALLS: Final = 0.02
_MOSTLY: Final = 0.5


def _by_collision(row: Row) -> float | None:
    """The share of the copies lost by receivers that collided."""
    lost = {key: value or 0.0 for key, value in row.items() if key.startswith("copies.lost.")}
    total = sum(lost.values())
    return lost.get("copies.lost.collision", 0.0) / total if total else None


def draw(runs: Runs) -> Drawing:
    figure, (pdr, lost) = canvas(2)
    data = []
    sources = runs.levels("traffic.sources")
    for look, interval_s in zip(SERIES, reversed(runs.levels("traffic.interval_s")), strict=False):
        named = look._replace(label=f"a packet every {interval_s:g} s")
        for axes, quantity, panel in ((pdr, "pdr", "pdr"), (lost, _by_collision, "lost by collision")):
            found = [runs.of(quantity, traffic__interval_s=interval_s, traffic__sources=count) for count in sources]
            line(axes, named, sources, found, most=1.0)
            data += [
                point(one, panel=panel, interval_s=interval_s, sources=count)
                for one, count in zip(found, sources, strict=True)
            ]
    pdr.set_title("(a) what arrives")
    pdr.set_ylabel("packet delivery ratio")
    lost.set_title("(b) why the rest does not")
    lost.set_ylabel("share of lost copies that collided")
    for axes in (pdr, lost):
        axes.set_xlabel("sources (of 45 nodes)")
        axes.set_ylim(0, 1.05)
        ticks_at(axes.xaxis, {count: str(count) for count in spaced(sources)})
    legend_above(figure, pdr)
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    sources = runs.levels("traffic.sources")
    falls, collide = [], []
    for interval_s in reversed(runs.levels("traffic.interval_s")):
        one, many = (
            runs.per_seed("pdr", traffic__interval_s=interval_s, traffic__sources=count)
            for count in (sources[0], sources[-1])
        )
        falls.append(
            Statement(
                f"every {interval_s:g} s: PDR with {sources[0]} minus with {sources[-1]} sources",
                differences(one, many),
                "above",
                _FALLS,
            )
        )
        shares = runs.per_seed(_by_collision, traffic__interval_s=interval_s, traffic__sources=sources[-1])
        collide.append(
            Statement(
                f"every {interval_s:g} s, {sources[-1]} sources: lost copies that collided",
                list(shares.values()),
                "above",
                _MOSTLY,
                possible=SHARE,
            )
        )
    return [
        Claim(9, "Under plain flooding the PDR falls as sources are added.", falls),
        Claim(9, "What is lost is lost to collisions.", collide),
    ]


FIGURE: Final = Recipe(
    "figure-9",
    "Plain flooding against the number of sources",
    "fig9",
    "45 nodes on a 9 x 5 grid, 200 m apart, range 250 m, 11 Mb/s; every packet of 1024 B is meant for every other "
    "node, and each node relays each packet once.",
    draw,
    claims,
)
