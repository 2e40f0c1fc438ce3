"""Beyond the paper: the delays of a swarm of real processes, over those of the same swarm in virtual time."""

from typing import Final

from sim.figures.finished_runs import Quantity, Runs, arrived, differences
from sim.figures.paper_claims import Claim, below, share_below
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.statistics import DISTANCE
from sim.figures.style import SERIES, band, canvas, legend_above, plain_log
from sim.sweep.measures import DELAY_EDGES_S

_PROTOCOLS: Final = {"flooding": "plain flooding", "ours": "fanet-mw: timetable, 0.5 s"}
_HOSTS: Final = {
    "virtual": SERIES[0]._replace(label="virtual time"),
    "real": SERIES[1]._replace(label="real time, a process for each UAV"),
}
_APART: Final = 0.05
_APART_MS: Final = 20.0
_LATE: Final = 0.001


def draw(runs: Runs) -> Drawing:
    figure, panels = canvas(len(_PROTOCOLS), share_y=True)
    data = []
    for letter, axes, (protocol, name) in zip("ab", panels, _PROTOCOLS.items(), strict=True):
        for host, look in _HOSTS.items():
            by_edge = arrived(runs, f"{protocol}, {host}")
            means = [one.mean for one in by_edge]
            axes.plot(DELAY_EDGES_S[: len(means)], means, color=look.color, linestyle=look.dash, label=look.label)
            band(axes, look, DELAY_EDGES_S[: len(means)], by_edge)
            data += [
                point(one, protocol=protocol, host=host, delay_s=edge)
                for one, edge in zip(by_edge, DELAY_EDGES_S, strict=False)
            ]
        axes.set_title(f"({letter}) {name}")
        axes.set_xscale("log")
        axes.set_xlim(0.05, 2)
        plain_log(axes.xaxis)
        axes.set_xlabel("end-to-end delay [s]")
        axes.set_ylim(0, 1.05)
    panels[0].set_ylabel("share of packets x targets")
    legend_above(figure, panels[0])
    return Drawing(figure, data)


def claims(runs: Runs) -> list[Claim]:
    def apart(quantity: Quantity, protocol: str) -> list[float]:
        real, virtual = (runs.per_seed(quantity, case=f"{protocol}, {host}") for host in ("real", "virtual"))
        return [abs(one) for one in differences(real, virtual)]

    as_virtual, in_time = [], []
    for protocol, name in _PROTOCOLS.items():
        median_ms = apart("delay_ms.p50", protocol)
        late = runs.per_seed("lateness.share", case=f"{protocol}, real")
        as_virtual.append(share_below(f"{name}: PDR, apart by", apart("pdr", protocol), _APART))
        as_virtual.append(below(f"{name}: median delay, apart by", median_ms, _APART_MS, "ms", possible=DISTANCE))
        in_time.append(share_below(f"{name}: share of frames that were late", late, _LATE))
    return [
        Claim(0, "Real time gives what virtual time says.", as_virtual),
        Claim(0, "Frames are announced in time.", in_time),
    ]


REALTIME: Final = Recipe(
    "realtime",
    "Real time laid over virtual time",
    "realtime",
    "12 UAVs, 11 sources of 512 B every 0.25 s to everyone. Delays include the lead of 60 ms with which frames are "
    "announced and the handover every 20 ms, in both. radio.cw_min is 31 for flooding and 7 for the "
    "timetable. Real time: 14 processes over the bus, one run at a time; their clock slows down, at most to a tenth, "
    "while the machine cannot keep up. A process that hands a packet over some milliseconds late may miss its turn: "
    "in a run compared with virtual time delivery by delivery, 9 of 100 came one turn (140 to 210 ms) later and "
    "the others within 20 ms. Bands: 95 % of the mean.",
    draw,
    claims,
)
