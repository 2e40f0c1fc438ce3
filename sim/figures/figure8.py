"""Figure 8: routing protocols of the field against speed. Claims of the paper: 4, on AODV and OLSR."""

import math
from typing import Final

from sim.figures.claims import Claim, Reason, above, below
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.runs import Quantity, Row, Runs, differences, pooled
from sim.figures.style import LOOKS, beside, canvas, legend_above, line, plain_log, ticks_at

_SPEED: Final = "mobility.speed_m_s"
_AT: Final = "mobility__speed_m_s"
_SHARP: Final = 0.1
"""A fall of the PDR by less than this is not called sharp."""
_LOW: Final = 0.9
"""A PDR below this is low: one packet in ten is lost."""
_HIGH: Final = 0.95
_IDLE: Final = 0.2
"""A busy share of the air below this leaves room for everyone."""
_HARDLY_MS: Final = 5.0
_APART_M_S: Final = 0.3
"""The marks of two lines at one speed stand so far apart."""
_NAMES: Final = {case: LOOKS[case].label for case in ("aodv", "olsr")}
"""The paper's protocols."""


def _below_limit(row: Row) -> float | None:
    """The difference of the share of pairs that any path connects and the PDR."""
    return None if row["pdr"] is None else float(row["connected"] - row["pdr"])


def draw(runs: Runs) -> Drawing:
    figure, (pdr, delay, rest) = canvas(3)
    data = []
    speeds = runs.levels(_SPEED)

    def places(number: int, of: int) -> list[float]:
        return [beside(speed, number, of, log=False, apart=_APART_M_S) for speed in speeds]

    drawn = ("limit", "aodv", "olsr", "flooding", "ours")
    for number, case in enumerate(drawn[1:], 1):
        for axes, column, unit in ((pdr, "leader_pdr", ""), (delay, "leader_delay_s", "s")):
            found = [runs.of(column, case=case, **{_AT: speed}) for speed in speeds]
            line(axes, LOOKS[case], places(number, len(drawn)), found, most=math.inf if unit else 1.0)
            data += [
                point(one, panel=column, unit=unit, series=case, speed_m_s=speed)
                for one, speed in zip(found, speeds, strict=True)
            ]
    limit = [runs.of("connected", case="aodv", **{_AT: speed}) for speed in speeds]
    line(pdr, LOOKS["limit"], places(0, len(drawn)), limit, most=1.0)
    data += [point(one, panel="connected", series="limit", speed_m_s=at) for one, at in zip(limit, speeds, strict=True)]
    for number, case in enumerate(_NAMES):
        found = [runs.of("pdr", case=f"{case}, formation", **{_AT: speed}) for speed in speeds]
        line(rest, LOOKS[case], places(number, len(_NAMES)), found, most=1.0)
        data += [
            point(one, panel="pdr, formation", series=case, speed_m_s=at) for one, at in zip(found, speeds, strict=True)
        ]
    for axes, title in (
        (pdr, "(a) random waypoints: what arrives"),
        (delay, "(b) random waypoints: how late"),
        (rest, "(c) rigid formation: what arrives"),
    ):
        axes.set_title(title)
        axes.set_xlabel("speed [m/s]")
        axes.set_ylabel("packet delivery ratio at the leader" if axes is not delay else "mean delay [s]")
        ticks_at(axes.xaxis, {speed: f"{speed:g}" for speed in speeds})
    for axes in (pdr, rest):
        axes.set_ylim(0, 1.05)
    delay.set_yscale("log")
    plain_log(delay.yaxis)
    legend_above(figure, pdr)
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    speeds = runs.levels(_SPEED)
    slow, fast = {_AT: speeds[0]}, {_AT: speeds[-1]}
    label = f"from {speeds[0]:g} to {speeds[-1]:g} m/s"

    def fall(quantity: Quantity, case: str) -> list[float]:
        """By how much it is less when all are fast than when all are slow, seed by seed."""
        return differences(runs.per_seed(quantity, case=case, **slow), runs.per_seed(quantity, case=case, **fast))

    def rise(quantity: Quantity, case: str) -> list[float]:
        return [-less for less in fall(quantity, case)]

    over = [{case: runs.per_seed("pdr", case=case, **{_AT: speed}) for case in _NAMES} for speed in speeds]
    ahead = differences(pooled(*(one["aodv"] for one in over)), pooled(*(one["olsr"] for one in over)))
    return [
        Claim(
            8,
            "The PDR of AODV and OLSR drops sharply with speed (nodes on random waypoints).",
            [above(f"{name}: fall of the PDR {label}", fall("pdr", case), _SHARP) for case, name in _NAMES.items()],
            [
                Reason(
                    "The swarm comes apart: on the way to its waypoints it spreads over an area in which a range of "
                    "250 m no longer connects it, whatever the protocol.",
                    [above(f"fall of the share of pairs with a path, {label}", fall("connected", "aodv"), _SHARP)],
                ),
                Reason(
                    "AODV loses little beyond that, OLSR much: its routes are older than the links.",
                    [
                        below("AODV: PDR lost beyond what geometry takes", rise(_below_limit, "aodv"), _SHARP),
                        above("OLSR: PDR lost beyond what geometry takes", rise(_below_limit, "olsr"), _SHARP),
                    ],
                ),
            ],
        ),
        Claim(
            8,
            "The PDR drops with speed also in the paper's own mobility, a formation (here a rigid one).",
            [
                above(f"{name}, formation: fall of the PDR {label}", fall("pdr", f"{case}, formation"), _SHARP)
                for case, name in _NAMES.items()
            ],
            [
                Reason(
                    "Relative motion does harm, not speed: in a rigid formation distances do not change, and neither "
                    "do routes. To fall with speed, a formation needs clusters that move relative to each other, or "
                    "UAVs that do so within them; the paper describes neither.",
                    [
                        above(
                            f"{name}, formation: PDR at {speeds[-1]:g} m/s",
                            runs.per_seed("pdr", case=f"{case}, formation", **fast),
                            _HIGH,
                        )
                        for case, name in _NAMES.items()
                    ],
                )
            ],
        ),
        Claim(
            8,
            "The PDR is low even when nodes are slow.",
            [
                below(f"{name}: PDR at {speeds[0]:g} m/s", runs.per_seed("pdr", case=case, **slow), _LOW)
                for case, name in _NAMES.items()
            ],
            [
                Reason(
                    "Nothing is there to lose packets: while a run lasts, the slowest swarm is nearly the grid that it "
                    "starts as, and a packet a second of each node leaves most of the air free.",
                    [
                        above("share of pairs with a path", runs.per_seed("connected", case="aodv", **slow), _HIGH),
                        below("AODV: busy share of the air", runs.per_seed("air.busy", case="aodv", **slow), _IDLE),
                    ],
                )
            ],
        ),
        Claim(8, "AODV's PDR is above OLSR's.", [above("AODV minus OLSR, all speeds", ahead, 0.0)]),
        Claim(
            8,
            "AODV's delay grows with speed.",
            [above(f"growth of the mean {label}", rise("delay_ms.mean", "aodv"), 0.0, "ms")],
            [
                Reason(
                    "Some packets wait at nodes, for a route; half are as early as before, and time on the air hardly "
                    "changes.",
                    [
                        above("growth of the wait at nodes", rise("delay_parts_ms.queue", "aodv"), 0.0, "ms"),
                        below("growth of the time on the air", rise("delay_parts_ms.air", "aodv"), _HARDLY_MS, "ms"),
                        below("growth of the median", rise("delay_ms.p50", "aodv"), _HARDLY_MS, "ms"),
                    ],
                )
            ],
        ),
    ]


FIGURE: Final = Recipe(
    "figure-8",
    "Routing protocols against speed",
    "fig8",
    "44 nodes send 1024 B a second to the leader; 2500 x 2500 m, range 250 m. Dotted: the share of nodes and seconds "
    "with any multi-hop path to the leader. fanet-mw sends to everyone, which is what it is made for, by relays that "
    "contend, and nodes that meet give each other what they lack: the dotted line does not bound it, and it pays in "
    "delay.",
    draw,
    claims,
)
