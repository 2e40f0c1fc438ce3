"""Figure 8: routing protocols of the field against speed. Claims of the paper: 4, on AODV and OLSR."""

from typing import Final

from sim.figures.claims import Claim, Statement
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.runs import Runs, differences, pooled
from sim.figures.style import LOOKS, canvas, line

_SPEED: Final = "mobility.speed_m_s"
_AT: Final = "mobility__speed_m_s"
_SHARP: Final = 0.1
"""A fall of the PDR by less than this is not called sharp."""
_LOW: Final = 0.9
"""A PDR below this is low: one packet in ten is lost."""


def draw(runs: Runs) -> Drawing:
    figure, (pdr, delay, rest) = canvas(3)
    data = []
    speeds = runs.levels(_SPEED)
    for case in ("aodv", "olsr", "flooding", "ours"):
        for axes, column, unit in ((pdr, "pdr", ""), (delay, "delay_ms.mean", "ms")):
            found = [runs.of(column, case=case, **{_AT: speed}) for speed in speeds]
            line(axes, LOOKS[case], speeds, found)
            data += [
                point(one, panel=column, unit=unit, series=case, speed_m_s=speed)
                for one, speed in zip(found, speeds, strict=True)
            ]
    limit = [runs.of("connected", case="aodv", **{_AT: speed}) for speed in speeds]
    line(pdr, LOOKS["limit"], speeds, limit)
    data += [point(one, panel="connected", series="limit", speed_m_s=at) for one, at in zip(limit, speeds, strict=True)]
    for case in ("aodv", "olsr"):
        found = [runs.of("pdr", case=f"{case}, formation", **{_AT: speed}) for speed in speeds]
        line(rest, LOOKS[case], speeds, found)
        data += [
            point(one, panel="pdr, formation", series=case, speed_m_s=at) for one, at in zip(found, speeds, strict=True)
        ]
    for axes, title in ((pdr, "(a) random waypoints"), (delay, "(b) random waypoints"), (rest, "(c) rigid formation")):
        axes.set_title(title)
        axes.set_xlabel("speed [m/s]")
        axes.set_ylabel("packet delivery ratio" if axes is not delay else "mean end-to-end delay [ms]")
    for axes in (pdr, rest):
        axes.set_ylim(0, 1.05)
    delay.set_yscale("log")
    pdr.legend(loc="lower left")
    rest.legend(loc="lower left")
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    speeds = runs.levels(_SPEED)
    slow, fast = {_AT: speeds[0]}, {_AT: speeds[-1]}
    label = f"from {speeds[0]:g} to {speeds[-1]:g} m/s"
    names = {case: LOOKS[case].label for case in ("aodv", "olsr")}
    falls = [
        Statement(
            f"{name}: fall of the PDR {label}",
            differences(runs.per_seed("pdr", case=case, **slow), runs.per_seed("pdr", case=case, **fast)),
            "above",
            _SHARP,
        )
        for case, name in names.items()
    ]
    low = [
        Statement(
            f"{name}: PDR at {speeds[0]:g} m/s", list(runs.per_seed("pdr", case=case, **slow).values()), "below", _LOW
        )
        for case, name in names.items()
    ]
    over = [{case: runs.per_seed("pdr", case=case, **{_AT: speed}) for case in names} for speed in speeds]
    ahead = differences(pooled(*(one["aodv"] for one in over)), pooled(*(one["olsr"] for one in over)))
    delays = differences(
        runs.per_seed("delay_ms.mean", case="aodv", **fast), runs.per_seed("delay_ms.mean", case="aodv", **slow)
    )
    formation = [
        Statement(
            f"{name} in a rigid formation: fall of the PDR {label}",
            differences(
                runs.per_seed("pdr", case=f"{case}, formation", **slow),
                runs.per_seed("pdr", case=f"{case}, formation", **fast),
            ),
            "above",
            _SHARP,
        )
        for case, name in names.items()
    ]
    return [
        Claim(
            8,
            "The PDR of AODV and OLSR drops sharply with speed (nodes on random waypoints).",
            falls,
            "Part of the fall is no protocol's: the line of what geometry allows falls as well, because waypoints "
            "spread the swarm over the area. OLSR falls farther, because its routes are older than the links.",
        ),
        Claim(
            8,
            "The PDR drops with speed also in the paper's own mobility, a formation of clusters.",
            formation,
            "In a rigid formation distances do not change, and neither do routes: relative motion does harm, not "
            "speed. What the paper saw at higher speed must come from relative motion between or within clusters.",
        ),
        Claim(
            8,
            "The PDR is low even when nodes are slow.",
            low,
            "The slowest swarm is still nearly the grid it starts as, within the time of a run: what geometry allows "
            "is near 1, and both protocols carry it.",
        ),
        Claim(8, "AODV's PDR is above OLSR's.", [Statement("AODV minus OLSR, all speeds", ahead, "above", 0.0)]),
        Claim(8, "AODV's delay grows with speed.", [Statement(f"growth {label}", delays, "above", 0.0, "ms")]),
    ]


FIGURE: Final = Recipe(
    "figure-8",
    "Routing protocols against speed",
    "fig8",
    "44 nodes send 1024 B a second to the leader; 2500 x 2500 m, range 250 m. Dotted: the share of nodes and seconds "
    "with any multi-hop path to the leader. fanet-mw (contending relays, with repair) carries packets until nodes "
    "meet: that line does not bound it, and it pays in delay.",
    draw,
    claims,
)
