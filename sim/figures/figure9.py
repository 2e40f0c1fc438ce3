"""Figure 9: plain flooding with different numbers of sources. The paper claims that the PDR falls because frames
collide.
"""

from typing import Final

from sim.figures.finished_runs import Row, Runs, differences
from sim.figures.paper_claims import Claim, above, alike, share_above
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.style import SERIES, canvas, crosses, legend_above, line, spaced, ticks_at

_FALLS: Final = 0.02
_MOSTLY: Final = 0.5
_ALIKE: Final = 0.02
_MOVING, _REST = "formation", "at rest"


def _by_collision(row: Row) -> float | None:
    """The share of the copies lost by receivers that collided."""
    lost = {key: value or 0.0 for key, value in row.items() if key.startswith("copies.lost.")}
    total = sum(lost.values())
    return lost.get("copies.lost.collision", 0.0) / total if total else None


def draw(runs: Runs) -> Drawing:
    figure, (pdr, lost) = canvas(2)
    data = []
    sources = runs.levels("traffic.sources", case=_MOVING)
    for look, interval_s in zip(SERIES, reversed(runs.levels("traffic.interval_s")), strict=False):
        named = look._replace(label=f"a packet every {interval_s:g} s")
        for axes, quantity, panel in ((pdr, "pdr", "pdr"), (lost, _by_collision, "lost by collision")):
            found = {
                case: [
                    (count, runs.of(quantity, case=case, traffic__interval_s=interval_s, traffic__sources=count))
                    for count in runs.levels("traffic.sources", case=case)
                ]
                for case in (_MOVING, _REST)
            }
            line(axes, named, sources, [one for _, one in found[_MOVING]], most=1.0)
            crosses(axes, look, [(count, one.mean) for count, one in found[_REST]])
            data += [
                point(one, panel=panel, motion=case, interval_s=interval_s, sources=count)
                for case, points in found.items()
                for count, one in points
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
    sources = runs.levels("traffic.sources", case=_MOVING)
    falls, collide, still = [], [], []
    for interval_s in reversed(runs.levels("traffic.interval_s")):
        one, many = (
            runs.per_seed("pdr", case=_MOVING, traffic__interval_s=interval_s, traffic__sources=count)
            for count in (sources[0], sources[-1])
        )
        rest = runs.per_seed("pdr", case=_REST, traffic__interval_s=interval_s, traffic__sources=sources[-1])
        still += alike(
            f"every {interval_s:g} s, {sources[-1]} sources: PDR in formation minus at rest",
            differences(many, rest),
            _ALIKE,
        )
        falls.append(
            above(
                f"every {interval_s:g} s: PDR with {sources[0]} minus with {sources[-1]} sources",
                differences(one, many),
                _FALLS,
            )
        )
        shares = runs.per_seed(
            _by_collision, case=_MOVING, traffic__interval_s=interval_s, traffic__sources=sources[-1]
        )
        what = f"every {interval_s:g} s, {sources[-1]} sources: lost copies that collided"
        collide.append(share_above(what, shares, _MOSTLY))
    return [
        Claim(9, "Under plain flooding the PDR falls as sources are added.", falls),
        Claim(9, "What is lost is lost to collisions.", collide),
        Claim(0, "Plain flooding delivers in a formation at 7.5 m/s what it delivers at rest.", still),
    ]


FIGURE: Final = Recipe(
    "figure-9",
    "Plain flooding against the number of sources",
    "fig9",
    "45 nodes on a 9 x 5 grid, 200 m apart, range 250 m, 11 Mb/s; every packet of 1024 B is meant for every other "
    "node, and each node relays each packet once. In formation at 7.5 m/s (lines), and at rest (crosses).",
    draw,
    claims,
)
