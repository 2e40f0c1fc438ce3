"""The pictures of one run's network: delays, delivery, and links over the area."""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from fanet_mw.trace import Delivered
from fanet_mw.units import MS, S
from sim.figures.colors import BLUE, DARK, GREEN, ORANGE, RED
from sim.figures.style import canvas, legend_above
from sim.report.run_records import RunRecords

_WINDOWS: Final = 40
"""The number of steps of the delivery ratio over time."""
_SHARES: Final = ListedColormap([colormaps["viridis"](step / 255) for step in range(200)])
"""From dark violet, links that lose everything, to green; the yellow end is invisible on white."""
_LONG_NS: Final = 10 * S
"""Delays are drawn in seconds if the longest is at least this long."""
_NARROWEST: Final = 0.35
"""The least ratio of a map's sides."""


class RunPicture(NamedTuple):
    """A figure with its caption."""

    figure: Figure
    caption: str


class _Delays(NamedTuple):
    """The packets of one application, and what of them was delivered."""

    name: str
    sent: Mapping[tuple[int, int], int]
    delivered: Sequence[Delivered]
    wanted: int
    """All packets x targets."""
    color: str
    bound_color: str


def delays(run: RunRecords) -> RunPicture | None:
    """The distributions of the delays of the load and of reports, each beside that of the stated bounds."""
    if not run.delivered and not run.reports_delivered:
        return None
    figure, (axes,) = canvas(1, width=6.5)
    others = run.scenario.node_count - 1
    loads = [
        _Delays("load", run.sent, run.delivered, sum(len(run.targets(origin)) for origin, _ in run.sent), BLUE, RED),
        _Delays("reports", run.reports, run.reports_delivered, len(run.reports) * others, GREEN, ORANGE),
    ]
    loads = [load for load in loads if load.delivered]
    bounds = {load.name: [bound for name, bound in run.bounds.items() if name in load.sent] for load in loads}
    all_ns = [one.delay_ns for load in loads for one in load.delivered] + [
        ns for each in bounds.values() for ns in each
    ]
    unit, unit_ns = ("s", S) if max(all_ns) >= _LONG_NS else ("ms", MS)
    for load in loads:
        of = f" of {load.name}" if len(loads) > 1 else ""
        _steps(axes, [one.delay_ns / unit_ns for one in load.delivered], load.wanted, f"delay{of}", load.color, "-")
        if stated := bounds[load.name]:
            label = f"bound{of}" if of else "bound stated by the origin"
            _steps(axes, [bound / unit_ns for bound in stated], len(load.sent), label, load.bound_color, "--")
    if len(loads) > 1 or any(bounds.values()):
        legend_above(figure, axes)
    axes.set_xlabel(f"end-to-end delay [{unit}]")
    axes.set_ylabel("share of packets x targets")
    axes.set_xlim(left=0)
    axes.set_ylim(0, 1.05)
    said = (
        "dashed, the share of packets for which the origin stated at most this bound."
        if any(bounds.values())
        else "no origin stated a bound."
    )
    return RunPicture(figure, f"The share of packets x targets that were delivered within a delay; {said}")


def _steps(axes: Axes, values: Sequence[float], whole: int, label: str, color: str, dash: object) -> None:
    ordered = sorted(values)
    axes.plot(ordered, [(rank + 1) / whole for rank in range(len(ordered))], color=color, label=label, linestyle=dash,
              drawstyle="steps-post")  # fmt: skip


def delivery(run: RunRecords) -> RunPicture | None:
    if not run.sent:
        return None
    figure, (over_time, per_node) = canvas(2, width=4.6)
    start_ns, end_ns = run.scenario.traffic_window_ns
    step_ns = max(1, (end_ns - start_ns) // _WINDOWS)
    wanted: Counter[int] = Counter()
    had: Counter[int] = Counter()
    of_node: dict[int, list[int]] = defaultdict(lambda: [0, 0])
    for (origin, _), t_ns in run.sent.items():
        for node in run.targets(origin):
            wanted[(t_ns - start_ns) // step_ns] += 1
            of_node[node][1] += 1
    for one in run.delivered:
        had[(run.sent[one.origin, one.seq] - start_ns) // step_ns] += 1
        of_node[one.node][0] += 1
    steps = sorted(wanted)
    times = [(start_ns + (step + 0.5) * step_ns) / S for step in steps]
    over_time.plot(times, [had[step] / wanted[step] for step in steps], color=BLUE)
    over_time.set_xlabel("instant at which packets were generated [s]")
    nodes = sorted(of_node)
    per_node.bar(nodes, [of_node[node][0] / of_node[node][1] for node in nodes], color=BLUE)
    per_node.set_xlabel("receiver (node id)")
    per_node.xaxis.set_major_locator(MaxNLocator(integer=True))
    for axes in (over_time, per_node):
        axes.set_ylabel("packet delivery ratio")
        axes.set_ylim(0, 1.05)
    return RunPicture(
        figure,
        f"Left: the delivery ratio of the packets generated in each {step_ns / S:.3g} s. Right: that of each receiver "
        "over the whole run. Packets of the end had less time to arrive: the run ends "
        f"{run.scenario.drain_s:g} s after the last one.",
    )


def links(run: RunRecords, counted: Sequence[Mapping[str, Any]]) -> RunPicture | None:
    places = run.places()
    known = [link for link in counted if link["copies"] and {link["src"], link["dst"]} <= places.at.keys()]
    if not known:
        return None
    ends = [(places.at[link["src"]], places.at[link["dst"]]) for link in known]
    shown = [
        index
        for index, (link, (here, there)) in enumerate(zip(known, ends, strict=True))
        if not places.moved or math.dist(here, there) <= run.reach_m(link["src"], link["dst"])
    ]
    figure, axes = map_canvas(list(places.at.values()))
    lines = LineCollection([ends[index] for index in shown], cmap=_SHARES, linewidths=1.3)
    lines.set_array([known[index]["received"] / known[index]["copies"] for index in shown])
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    heads = {head for head in run.heads.values() if head}
    for wanted, label, marker in ((True, "cluster head", "s"), (False, "node", "o")):
        chosen = [at for node, at in places.at.items() if (node in heads) == wanted]
        if chosen:
            axes.scatter([at[0] for at in chosen], [at[1] for at in chosen], marker=marker, s=26, zorder=3,
                         color=DARK if wanted else "#ffffff", edgecolors=DARK, label=label)  # fmt: skip
    legend_above(figure, axes)
    figure.colorbar(
        lines, ax=axes, fraction=0.05, label="copies received / copies in range", format=PercentFormatter(1.0)
    )
    caption = f"Links by the share of copies received in the whole run; nodes {places.said}."
    if places.moved:
        post, uav = run.scenario.post, run.scenario.uav_ids[0]
        reach_m, of_post_m = run.reach_m(uav, uav), run.reach_m(uav, post or uav)
        farther = f" ({of_post_m:.0f} m from the post)" if of_post_m > reach_m else ""
        caption += (
            f" Drawn are the {len(shown):,} directed links between nodes that were within {reach_m:.0f} m{farther} of "
            "each other there, the radio's reach; "
            f"{len(known) - len(shown):,} other pairs were in range at other times."
        )
    return RunPicture(figure, caption)


def map_canvas(places: Sequence[tuple[float, float]]) -> tuple[Figure, Axes]:
    """A figure in which a metre to the east is as long as one to the north, in the shape of what it shows."""
    spans = [(min(at[axis] for at in places), max(at[axis] for at in places)) for axis in (0, 1)]
    longest_m = max(high - low for low, high in spans) or 1.0
    reaches_m = [max((high - low) / 2 + 0.05 * longest_m, _NARROWEST * longest_m / 2) for low, high in spans]
    figure, (axes,) = canvas(1, width=6.5, height=1.4 + 4.4 * min(1.0, reaches_m[1] / reaches_m[0]))
    axes.set_aspect("equal")
    (west, east), (south, north) = (
        ((low + high) / 2 - reach_m, (low + high) / 2 + reach_m)
        for (low, high), reach_m in zip(spans, reaches_m, strict=True)
    )
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    return figure, axes
