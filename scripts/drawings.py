#!/usr/bin/env python
"""Draws what explanations explain, into docs/explanation/drawings (needs matplotlib): `scripts/drawings.py [NAME ...]`.

The flood is one of the timetable that the product computes, and the search one of its formations.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from agents.mission.searcher import formation  # noqa: E402  (the root is on the path now)
from fanet_mw.routing.clustered.timetable.interference import Geometry  # noqa: E402
from fanet_mw.routing.clustered.timetable.timetable import timetable  # noqa: E402
from fanet_mw.routing.rounds.round_timing import RoundTiming  # noqa: E402
from fanet_mw.units import MS, Enu, NodeId  # noqa: E402
from sim.figures.colors import BLUE, DARK, GRAY, GREEN, ORANGE, PINK, RED, SHADE  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.scenarios import catalog  # noqa: E402
from sim.world.environment.layout import positions  # noqa: E402

FOLDER: Final = ROOT / "docs" / "explanation" / "drawings"
Bar = tuple[float, float, str, str]
"""Begin, length, color, text."""


def bare(axes: Axes, wide: float, high: float) -> None:
    axes.set(xlim=(0, wide), ylim=(0, high))
    axes.axis("off")


def box(axes: Axes, at: tuple[float, float], size: tuple[float, float], text: str, color: str = "white") -> None:
    axes.add_patch(FancyBboxPatch(at, *size, boxstyle="round,pad=0.02", facecolor=color, edgecolor=DARK, linewidth=1))
    axes.text(at[0] + size[0] / 2, at[1] + size[1] / 2, text, ha="center", va="center", fontsize=8)


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "", *, above: float = 0.08
) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": DARK, "shrinkA": 2, "shrinkB": 2})
    if text:
        axes.text((start[0] + end[0]) / 2, (start[1] + end[1]) / 2 + above, text, ha="center", fontsize=7, color=DARK)


def rows(axes: Axes, lines: Sequence[tuple[str, Sequence[Bar]]], *, unit: str, wide: float) -> None:
    """Bars in time, a row for each line."""
    for number, (name, bars) in enumerate(reversed(lines)):
        axes.text(-0.01 * wide, number, name, ha="right", va="center", fontsize=8)
        for begin, length, color, text in bars:
            edge = 0.6 if length > wide / 250 else 0.1
            axes.barh(number, length, 0.7, begin, color=color, edgecolor=DARK, linewidth=edge)
            ink = "white" if color in (BLUE, GRAY) else DARK
            axes.text(begin + length / 2, number, text, ha="center", va="center", fontsize=7, color=ink)
    axes.set(xlim=(0, wide), ylim=(-0.6, len(lines) - 0.4), yticks=[], xlabel=unit)
    for side in ("left", "right", "top"):
        axes.spines[side].set_visible(False)


def superframes() -> Figure:
    """One flooding period under three methods."""
    figure, (axes,) = canvas(width=8.4, height=2.6)
    slots = [(k * 125.0, 115.0, color, f"head {k + 1}") for k, color in enumerate((BLUE, ORANGE, GREEN, PINK))]
    guards = [(k * 125.0 + 115, 10.0, GRAY, "") for k in range(4)]
    turns = [(40 + k * 2.875, 2.875, (BLUE, ORANGE, GREEN, PINK, RED)[k % 5], "") for k in range(160)]
    ring = RoundTiming.of(catalog.find("rescue"))
    of_nodes = [
        (
            ring.turn_start_ns(node, from_ns=begin_ns) / MS,
            ring.turn_ns / MS,
            (BLUE, ORANGE, GREEN, PINK, RED)[node % 5],
            "",
        )
        for node in range(1, ring.nodes + 1)
        for begin_ns in range(0, 3 * ring.period_ns, ring.period_ns)
    ]
    bulk = [
        ((begin_ns + block.slots_start_ns) / MS, block.slots * ring.slot_ns / MS, SHADE, "bulk")
        for block in ring.blocks
        for begin_ns in range(0, 3 * ring.period_ns, ring.period_ns)
    ]
    rows(
        axes,
        [
            ("all, counter", slots + guards),
            ("scheduled", [(0.0, 40.0, SHADE, "window"), *turns]),
            ("rounds", [*of_nodes, *bulk]),
        ],
        unit="ms of a flooding period of 0.5 s; gray: guard time, one color after the other: turns of one frame each",
        wide=500,
    )
    return figure


def flood() -> Figure:
    """A flood of the shipped grid through its timetable: in which turn each relay sends."""
    places = {
        NodeId(5 * column + row + 1): Enu(200.0 * column, 200.0 * row, 50.0) for column in range(9) for row in range(5)
    }
    root = NodeId(1)
    table = timetable(tuple(sorted(places.items())), tuple(sorted(places)), Geometry(250, 400, 260, 2))
    assert table is not None, "the load of the grid fits"
    sent = {turn.node: turn.offset for turn in table.turns if turn.root == root and turn.instance == 0}
    begin = sent[root]
    figure, (axes,) = canvas(width=8.4, height=4.2)
    bare(axes, 1750, 900)
    axes.set(xlim=(-90, 1690), ylim=(-90, 890))
    for node, place in places.items():
        shade = (sent[node] - begin) / table.spans[root] if node in sent else 0
        axes.scatter(
            place.east,
            place.north,
            s=420,
            color=BLUE if node in sent else "white",
            alpha=1 - 0.75 * shade,
            edgecolor=DARK,
        )
        axes.text(
            place.east,
            place.north,
            f"+{sent[node] - begin}" if node in sent else "",
            ha="center",
            va="center",
            fontsize=7,
            color="white" if node in sent and shade < 0.3 else DARK,
        )
    axes.set_aspect("equal")
    axes.set_title(
        f"Node 1 floods: {len(sent)} of 45 send, all have it after {table.spans[root]} turns (+: turns after its own)"
    )
    return figure


def search() -> Figure:
    """The lines of `rescue` as their sweep begins, on the way and at the edge, and who must stay in reach of whom."""
    made = catalog.find("rescue", [])
    whole = formation(made, made.nodes.count)
    assert whole is not None, "rescue is shipped"
    pattern = whole.begun_around([Enu(*at) for at in positions(made)])[0]
    edge_s = pattern.shape.sweep_s
    figure, panels = canvas(columns=3, width=2.8, height=3.5, share_y=True)
    half_m = made.world.area_m / 2
    titles = ("the sweep begins", "half of the way", "at the edge")
    for axes, title, swept_s in zip(panels, titles, (0.0, edge_s / 2, edge_s), strict=True):
        at = [pattern.at(place, swept_s) for place in range(pattern.places)]
        for place in range(pattern.places):
            for other in pattern.tethers(place, swept_s):
                axes.plot(*zip(at[place][:2], at[other][:2], strict=True), color=GRAY, linewidth=0.8, zorder=1)
        for kind, color, mark, what in (
            ("line", BLUE, "o", "in two lines"), ("relay", RED, "s", "relays"), ("follower", ORANGE, "^", "followers"),
        ):  # fmt: skip
            of_kind = [at[place][:2] for place in range(pattern.places) if pattern.kind(place) == kind]
            axes.scatter(*zip(*of_kind, strict=True), s=14, color=color, marker=mark, label=f"{len(of_kind)} {what}")
        axes.add_patch(Rectangle((-half_m, -half_m), 2 * half_m, 2 * half_m, fill=False, edgecolor=DARK, linestyle=":"))
        axes.set(title=f"{title}: {swept_s:.0f} s", xlabel="east [m]", aspect="equal")
    panels[0].set_ylabel("north [m]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def dcf() -> Figure:
    """A data frame and its ACK, two frames that collide, and who waits for how long."""
    data, ack, sifs, slot, difs, eifs = 900.0, 304.0, 10.0, 20.0, 50.0, 364.0
    backoff = 5 * slot
    end = difs + backoff + data
    acked = end + sifs + ack
    again = acked + difs + 3 * slot
    lost = again + data
    figure, (axes,) = canvas(width=8.4, height=2.8)
    rows(
        axes,
        [
            (
                "A",
                [
                    (0, difs, SHADE, ""),
                    (difs, backoff, ORANGE, "5"),
                    (difs + backoff, data, BLUE, "data to B"),
                    (acked, difs, SHADE, ""),
                    (acked + difs, 3 * slot, ORANGE, "3"),
                    (again, data, RED, "data"),
                ],
            ),
            ("B", [(end + sifs, ack, GREEN, "ACK"), (again, 0.92 * data, RED, "data, the same draw")]),
            (
                "C",
                [
                    (0, difs, SHADE, ""),
                    (difs, backoff, ORANGE, "5 of 9"),
                    (difs + backoff, data, GRAY, "busy: frozen"),
                    (end + sifs, ack, GRAY, "busy"),
                    (acked, difs, SHADE, ""),
                    (acked + difs, 3 * slot, ORANGE, "3"),
                    (again, data, GRAY, "two at once: noise"),
                    (lost, eifs, PINK, "EIFS"),
                    (lost + eifs, slot, ORANGE, ""),
                    (lost + eifs + slot, 300, BLUE, "data"),
                ],
            ),
        ],
        unit="us; pale: DIFS, 50; orange: backoff in slots of 20; EIFS: 364, after a frame that could not be decoded",
        wide=lost + eifs + 320,
    )
    return figure


def delay() -> Figure:
    """The parts of a bound, by method, for 45 nodes."""
    figure, (axes,) = canvas(width=8.4, height=2.2)
    rows(
        axes,
        [
            (
                "a head's slot",
                [
                    (0, 20, SHADE, ""),
                    (20, 500, ORANGE, "wait for the slot: up to the flooding period"),
                    (520, 90, GRAY, "queue"),
                    (610, 60, BLUE, "flood"),
                ],
            ),
            (
                "timetable",
                [
                    (0, 20, SHADE, ""),
                    (20, 460, ORANGE, "wait for an own turn: up to the gap between two"),
                    (480, 60, BLUE, "span"),
                    (540, 10, GREEN, ""),
                    (550, 20, SHADE, ""),
                ],
            ),
            (
                "rounds",
                [
                    (0, 20, SHADE, ""),
                    (20, 137, BLUE, "hop: a round"),
                    (157, 137, BLUE, "hop"),
                    (294, 137, BLUE, "hop"),
                    (431, 274, PINK, "two hops for change"),
                ],
            ),
        ],
        unit="ms, drawn to scale for the grid; pale: one lead at each end; green: handover",
        wide=720,
    )
    return figure


def beacons() -> Figure:
    """A time beacon in two steps."""
    figure, (axes,) = canvas(width=8.4, height=2.6)
    bare(axes, 10, 4)
    for high, name in ((3.0, "sender, swarm time known"), (1.0, "receiver, its own clock")):
        axes.annotate("", (9.9, high), (0.2, high), arrowprops={"arrowstyle": "->", "color": DARK})
        axes.text(0.2, high + 0.15, name, fontsize=8)
    for begin, text in ((2.2, "hello n"), (6.2, "hello n + 1: n ended at T")):
        for high in (3.0, 1.0):
            axes.add_patch(Rectangle((begin + (3 - high) * 0.05, high), 1.6, 0.35, facecolor=SHADE, edgecolor=DARK))
        axes.text(begin + 0.8, 3.55, text, ha="center", fontsize=8)
    axes.plot([3.8, 3.8], [3.0, 2.5], color=BLUE)
    axes.text(3.8, 2.2, "T: ends, by swarm time", ha="center", fontsize=8, color=BLUE)
    axes.plot([3.9, 3.9], [1.0, 0.6], color=RED)
    axes.text(3.9, 0.3, "t: ends, by the own clock", ha="center", fontsize=8, color=RED)
    arrow(axes, (7.9, 1.7), (7.9, 1.45))
    axes.text(7.9, 1.85, "a pair (t, T + flight time): a point of the line", ha="center", fontsize=8)
    return figure


def hosts() -> Figure:
    """The same actors on two hosts."""
    figure, (left, right) = canvas(columns=2, width=4.3, height=3.2)
    for axes in (left, right):
        bare(axes, 10, 8)
        for column, name in enumerate(("UAV 1", "UAV 2", "medium", "world")):
            box(axes, (0.1 + 2.5 * column, 5.2), (2.1, 1.1), name, SHADE if column < 2 else "#dbe9f4")
    box(
        left,
        (0.1, 2.6),
        (9.6, 1.2),
        "virtual host: one heap of (instant, number)\nas fast as it goes, the same bytes per seed",
        "white",
    )
    left.set_title("one process, virtual time")
    for column in range(4):
        arrow(left, (1.15 + 2.5 * column, 5.1), (1.15 + 2.5 * column, 3.95))
        box(right, (0.1 + 2.5 * column, 3.2), (2.1, 1.2), "host:\nasyncio", "white")
        arrow(right, (1.15 + 2.5 * column, 5.1), (1.15 + 2.5 * column, 4.5))
        arrow(right, (1.15 + 2.5 * column, 3.1), (1.15 + 2.5 * column, 2.0))
    box(right, (0.1, 0.7), (9.6, 1.2), "Zenoh: topics, one swarm clock, lateness counted", "white")
    right.set_title("a process each, real time")
    left.text(5, 1.2, "messages and instants go in,\nmessages and the next wake-up come out", ha="center", fontsize=8)
    left.text(5, 7.0, "the same actors", ha="center", fontsize=8)
    right.text(5, 7.0, "the same actors", ha="center", fontsize=8)
    return figure


def way() -> Figure:
    """The way of a packet."""
    figure, (axes,) = canvas(width=8.4, height=3.0)
    bare(axes, 20, 8)
    steps = (
        "application\nport.send",
        "node\nheader, number",
        "protocol\nwhen, and who",
        "medium\nDCF, SINR",
        "node\nknown? valid?",
        "application\non_message",
    )
    for number, text in enumerate(steps):
        box(
            axes,
            (0.2 + 3.35 * number, 3.4),
            (2.7, 1.5),
            text,
            ("white", SHADE, SHADE, "#dbe9f4", SHADE, "white")[number],
        )
        if number:
            arrow(axes, (3.35 * number - 0.4, 4.15), (0.15 + 3.35 * number, 4.15))
    axes.text(10.3, 5.6, "TxRequest(start_ns), one lead ahead", ha="center", fontsize=8)
    arrow(axes, (8.6, 5.4), (11.0, 5.0))
    axes.text(14.2, 6.6, "Reception, handed over together", ha="center", fontsize=8)
    arrow(axes, (13.2, 6.4), (14.2, 5.0))
    axes.annotate(
        "", (8.2, 3.3), (15.0, 3.3), arrowprops={"arrowstyle": "->", "color": DARK, "connectionstyle": "arc3,rad=-0.25"}
    )
    axes.text(11.6, 1.3, "relayed: the protocol returns it to its own port", ha="center", fontsize=8)
    return figure


def ledgers() -> Figure:
    """Both ledgers of a run: where each frame and each copy ends."""
    figure, (frames, copies) = canvas(columns=2, width=4.3, height=2.6)
    for axes, title, parts in (
        (
            frames,
            "frames: sent = the sum",
            (("delivered", GREEN), ("dropped, by reason", RED), ("in flight", GRAY), ("unaccounted: 0", "white")),
        ),
        (
            copies,
            "copies: on the air = the sum",
            (("received", GREEN), ("lost: collision, noise, busy, fault", RED), ("in flight", GRAY)),
        ),
    ):
        bare(axes, 10, 6)
        axes.set_title(title)
        box(
            axes, (0.2, 2.2), (2.6, 1.6), "transmit\nrequests" if axes is frames else "frame x\nstation in range", SHADE
        )
        for number, (text, color) in enumerate(parts):
            high = 4.7 - 1.35 * number
            box(axes, (4.4, high), (5.4, 0.95), text, color)
            arrow(axes, (2.9, 3.0), (4.3, high + 0.5))
    return figure


DRAWINGS: Final[dict[str, Callable[[], Figure]]] = {
    function.__name__: function for function in (superframes, flood, search, dcf, delay, beacons, hosts, way, ledgers)
}


def main(names: Sequence[str]) -> int:
    if unknown := set(names) - set(DRAWINGS):
        sys.stderr.write(f"no drawing {', '.join(sorted(unknown))}; there are {', '.join(DRAWINGS)}\n")
        return 2
    FOLDER.mkdir(exist_ok=True)
    for name in names or DRAWINGS:
        with applied():
            DRAWINGS[name]().savefig(FOLDER / f"{name}.png", dpi=110)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
