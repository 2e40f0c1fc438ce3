"""Figure 8: routing protocols at different speeds, with four claims of the paper about AODV and OLSR."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from matplotlib.axes import Axes

from sim.figures.finished_runs import Quantity, Row, Runs, differences, mean_per_seed
from sim.figures.paper_claims import Claim, Reason, above, below, share_above, share_below
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.style import LOOKS, Look, beside, canvas, legend_above, line, look_of, plain_log, ticks_at

_SPEED: Final = "mobility.speed_m_s"
_AT: Final = "mobility__speed_m_s"
_SHARP: Final = 0.1
"""A smaller decrease of the PDR than this is not called sharp."""
_LOW: Final = 0.9
"""A PDR below this is called low, because one packet in ten is lost."""
_HIGH: Final = 0.95
_IDLE: Final = 0.2
"""A channel that is busy for a smaller share than this has room for all."""
_HARDLY_MS: Final = 5.0
_APART_M_S: Final = 0.3
"""The distance of the marks of two lines at the same speed."""
_NAMES: Final = {case: LOOKS[case].label for case in ("aodv", "olsr")}
"""The paper's protocols."""
_VARIANTS: Final = {"ours": "fanet-mw: 44 heads, 0.5 s, counter, repair"}


def _below_limit(row: Row) -> float | None:
    """The share of pairs that any path connects, minus the PDR."""
    return None if row["pdr"] is None else float(row["connected"] - row["pdr"])


class _Curve(NamedTuple):
    """One line of a panel: a quantity of one case over the speeds at which it was run."""

    quantity: Quantity
    case: str
    look: Look
    panel: str
    unit: str = ""
    """The unit of the quantity; a quantity without one is a share."""

    def draw(self, runs: Runs, axes: Axes, *, number: int, of: int) -> list[Mapping[str, Any]]:
        speeds = runs.levels(_SPEED, case=self.case)
        found = [runs.of(self.quantity, case=self.case, **{_AT: speed}) for speed in speeds]
        places = [beside(speed, number, of, log=False, apart=_APART_M_S) for speed in speeds]
        line(axes, self.look, places, found, most=math.inf if self.unit else 1.0)
        return [
            point(one, panel=self.panel, unit=self.unit, series=self.look.label, speed_m_s=speed)
            for one, speed in zip(found, speeds, strict=True)
        ]


def draw(runs: Runs) -> Drawing:
    figure, (pdr, delay, rest) = canvas(3)
    looks = {case: look_of(case, _VARIANTS) for case in (*_NAMES, "flooding", "ours") if runs.where(case=case)}
    arrives = [_Curve("leader_pdr", case, look, "delivery ratio") for case, look in looks.items()]
    panels = {
        pdr: [_Curve("connected", "aodv", LOOKS["limit"], "delivery ratio"), *arrives],
        delay: [_Curve("leader_delay_s", case, look, "mean delay", "s") for case, look in looks.items()],
        rest: [_Curve("pdr", f"{case}, formation", LOOKS[case], "delivery ratio, formation") for case in _NAMES],
    }
    data = [
        row
        for axes, lines in panels.items()
        for number, one in enumerate(lines)
        for row in one.draw(runs, axes, number=number, of=len(lines))
    ]
    for axes, title in (
        (pdr, "(a) random waypoints: what arrives"),
        (delay, "(b) random waypoints: how late"),
        (rest, "(c) rigid formation: what arrives"),
    ):
        axes.set_title(title)
        axes.set_xlabel("speed [m/s]")
        axes.set_ylabel("delivery ratio at the leader" if axes is not delay else "mean delay [s]")
        ticks_at(axes.xaxis, {speed: f"{speed:g}" for speed in runs.levels(_SPEED)})
    for axes in (pdr, rest):
        axes.set_ylim(0, 1.05)
    delay.set_yscale("log")
    plain_log(delay.yaxis)
    legend_above(figure, pdr)
    return Drawing(figure, data)


def _seen(runs: Runs, quantity: Quantity, case: str, speed_m_s: float) -> dict[int, float]:
    return runs.per_seed(quantity, case=case, **{_AT: speed_m_s})


def _slow(runs: Runs, quantity: Quantity, case: str) -> dict[int, float]:
    return _seen(runs, quantity, case, runs.levels(_SPEED)[0])


def _fast(runs: Runs, quantity: Quantity, case: str) -> dict[int, float]:
    return _seen(runs, quantity, case, runs.levels(_SPEED)[-1])


def _fall(runs: Runs, quantity: Quantity, case: str) -> list[float]:
    """The quantity at the lowest speed minus that at the highest, for each seed."""
    return differences(_slow(runs, quantity, case), _fast(runs, quantity, case))


def _rise(runs: Runs, quantity: Quantity, case: str) -> list[float]:
    """The quantity at the highest speed minus that at the lowest, for each seed."""
    return differences(_fast(runs, quantity, case), _slow(runs, quantity, case))


def _span(runs: Runs) -> str:
    speeds = runs.levels(_SPEED)
    return f"from {speeds[0]:g} to {speeds[-1]:g} m/s"


def _falls_on_waypoints(runs: Runs) -> Claim:
    apart = Reason(
        "The swarm comes apart: on the way to its waypoints it spreads over an area in which a range of 250 m no "
        "longer connects it, whatever the protocol.",
        [above(f"fall of the share of pairs with a path, {_span(runs)}", _fall(runs, "connected", "aodv"), _SHARP)],
    )
    old_routes = Reason(
        "AODV loses little beyond that, OLSR much: its routes are older than the links.",
        [
            below("AODV: PDR lost beyond what geometry takes", _rise(runs, _below_limit, "aodv"), _SHARP),
            above("OLSR: PDR lost beyond what geometry takes", _rise(runs, _below_limit, "olsr"), _SHARP),
        ],
    )
    return Claim(
        8,
        "The PDR of AODV and OLSR drops sharply with speed (nodes on random waypoints).",
        [
            above(f"{name}: fall of the PDR {_span(runs)}", _fall(runs, "pdr", case), _SHARP)
            for case, name in _NAMES.items()
        ],
        [apart, old_routes],
    )


def _falls_in_formation(runs: Runs) -> Claim:
    fastest = f"{runs.levels(_SPEED)[-1]:g} m/s"
    relative_motion = Reason(
        "Relative motion does harm, not speed: in a rigid formation distances do not change, and neither do routes. "
        "To fall with speed, a formation needs clusters that move relative to each other, or UAVs that do so within "
        "them; the paper describes neither.",
        [
            share_above(f"{name}, formation: PDR at {fastest}", _fast(runs, "pdr", f"{case}, formation"), _HIGH)
            for case, name in _NAMES.items()
        ],
    )
    return Claim(
        8,
        "The PDR drops with speed also in the paper's own mobility, a formation (here a rigid one).",
        [
            above(f"{name}, formation: fall of the PDR {_span(runs)}", _fall(runs, "pdr", f"{case}, formation"), _SHARP)
            for case, name in _NAMES.items()
        ],
        [relative_motion],
    )


def _is_low_when_slow(runs: Runs) -> Claim:
    slowest = f"{runs.levels(_SPEED)[0]:g} m/s"
    nothing_lost = Reason(
        "Nothing is there to lose packets: while a run lasts, the slowest swarm is nearly the grid that it starts as, "
        "and a packet a second of each node leaves most of the air free.",
        [
            share_above("share of pairs with a path", _slow(runs, "connected", "aodv"), _HIGH),
            share_below("AODV: busy share of the air", _slow(runs, "air.busy", "aodv"), _IDLE),
        ],
    )
    return Claim(
        8,
        "The PDR is low even when nodes are slow.",
        [share_below(f"{name}: PDR at {slowest}", _slow(runs, "pdr", case), _LOW) for case, name in _NAMES.items()],
        [nothing_lost],
    )


def _aodv_above_olsr(runs: Runs) -> Claim:
    speeds = runs.levels(_SPEED, case="aodv")
    aodv, olsr = (mean_per_seed(*(_seen(runs, "pdr", case, at) for at in speeds)) for case in ("aodv", "olsr"))
    return Claim(8, "AODV's PDR is above OLSR's.", [above("AODV minus OLSR, all speeds", differences(aodv, olsr), 0.0)])


def _delay_grows(runs: Runs) -> Claim:
    under_way_ms = _rise(runs, "delay_parts_ms.air", "aodv")
    some_wait = Reason(
        "Some packets wait at their origin, for a route; half are as early as before, and the time from the first "
        "frame on hardly changes.",
        [
            above("growth of the wait at the origin", _rise(runs, "delay_parts_ms.queue", "aodv"), 0.0, "ms"),
            below("growth of the time from the first frame on", under_way_ms, _HARDLY_MS, "ms"),
            below("growth of the median", _rise(runs, "delay_ms.p50", "aodv"), _HARDLY_MS, "ms"),
        ],
    )
    return Claim(
        8,
        "AODV's delay grows with speed.",
        [above(f"growth of the mean {_span(runs)}", _rise(runs, "delay_ms.mean", "aodv"), 0.0, "ms")],
        [some_wait],
    )


_CLAIMS: Final = (_falls_on_waypoints, _falls_in_formation, _is_low_when_slow, _aodv_above_olsr, _delay_grows)


def claims(runs: Runs) -> list[Claim]:
    return [claim(runs) for claim in _CLAIMS]


FIGURE: Final = Recipe(
    "figure-8",
    "Routing protocols against speed",
    "fig8",
    "44 nodes send 1024 B a second to the leader; 2500 x 2500 m, range 250 m. Dotted: the share of nodes and seconds "
    "with any multi-hop path to the leader. fanet-mw (every node a head, flooding period 0.5 s, relays that count "
    "copies, repair) sends to everyone, which is what it is made for, and nodes that meet give each other what they "
    "lack: the dotted line does not bound it, and it pays in delay.",
    draw,
    claims,
)
