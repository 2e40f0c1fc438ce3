"""The pictures of when nodes let packets out, against what the protocol gives them: slots of heads, turns, rounds.

Of turns the last timetable is drawn, or the time of the run if that came too late to show anything.
"""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fanet_mw.trace import LetOut
from fanet_mw.units import MS, S
from sim.figures.colors import BLUE, DARK, GRAY, GREEN, ORANGE, PINK, RED, SHADE
from sim.figures.style import canvas, legend_above
from sim.observation.turns import Span, Turns, turns
from sim.report.run_pictures import RunPicture
from sim.report.run_records import RunRecords

_CLUSTERS: Final = (BLUE, RED, GREEN, PINK, ORANGE)
_MOST_NAMED: Final = 12
"""The greatest number of slots that are named above them."""
_MOST_LINES: Final = 1000
"""The greatest number of slots that are told apart; a folder of somebody else may state any."""
_LEAST_SHOWN: Final = 0.1
"""The share of the packets that a timetable must be for, to be drawn."""
_WINDOW_COLOR: Final = "#eeeeee"


def slots(run: RunRecords, reports: Mapping[int, Mapping[str, Any]]) -> RunPicture | None:
    """The picture for the protocol of a run; None if it gives no time to anybody, or nothing was let out."""
    if not run.let_out:
        return None
    found = turns(run.scenario, reports)
    if found is not None and run.scenario.routing.protocol == "rounds":
        return _in_rounds(run, found)
    if run.scenario.routing.protocol != "clustered":
        return None
    return _in_turns(run, found) if found is not None and found.called == "turn" else _in_slots(run, reports)


def _in_slots(run: RunRecords, reports: Mapping[int, Mapping[str, Any]]) -> RunPicture:
    """Superframes begin at multiples of the period, whichever schedule is in force, so all have the same places."""
    told = [report["slots"] for report in reports.values() if report.get("slots")]
    period_ns = _ns(told[0]["period_ms"]) if told else run.scenario.clusters.period_ns
    slot_ns = min((_ns(one["slot_ms"]) for one in told), default=0)
    guard_ns = _ns(told[0]["guard_ms"]) if told else 0
    by_cluster: dict[int, list[LetOut]] = defaultdict(list)
    others: list[LetOut] = []
    for one in run.let_out:
        cluster = _cluster_led_by(run, one)
        (others if cluster is None else by_cluster[cluster]).append(one)
    figure, (axes,) = canvas(1, width=7.5, height=4.8)
    _scatter(axes, [(one.t_ns % period_ns / MS, one.t_ns / S) for one in others], GRAY, ".", "packets of members", 7)
    named = len(by_cluster) <= len(_CLUSTERS)
    kept = 0
    for cluster, let_out in sorted(by_cluster.items()):
        places = [(one.t_ns % period_ns / MS, one.t_ns / S) for one in let_out]
        label = f"of the head of slot {cluster + 1}" if named else "of heads" if cluster == min(by_cluster) else None
        _scatter(axes, places, _CLUSTERS[cluster % len(_CLUSTERS)], "|", label, 40)
        kept += sum((one.t_ns % period_ns - cluster * slot_ns) % period_ns < slot_ns - guard_ns for one in let_out)
    slots = period_ns // slot_ns if slot_ns else 0
    for slot in range(min(slots, _MOST_LINES)):
        axes.axvline(slot * slot_ns / MS, color="#999999", linewidth=0.7, zorder=0)
        if slots <= _MOST_NAMED:
            axes.text((slot + 0.5) * slot_ns / MS, 1.0, f"slot {slot + 1}", transform=axes.get_xaxis_transform(),
                      ha="center", va="bottom", fontsize=8)  # fmt: skip
    _frame_axes(axes, period_ns, "superframe")
    axes.set_ylabel("swarm time [s]")
    axes.set_ylim(0, run.end_s)
    legend_above(figure, axes)
    said = "When packets were let out first, by place in the flooding period."
    if slots:
        said += (
            f" Each cluster has one slot. Of {len(run.let_out) - len(others):,} packets of heads, {kept:,} were let "
            "out in the slot of their cluster; members send their packets to a head by contention."
        )
    return RunPicture(figure, said)


def _cluster_led_by(run: RunRecords, one: LetOut) -> int | None:
    """The cluster of which the origin of a packet was the head when it let it out; None if it was none."""
    roles = run.roles.get(one.node, ())
    index = bisect_right(roles, one.t_ns, key=lambda role: role.t_ns)
    return roles[index - 1].cluster if index and roles[index - 1].role == "head" else None


def _in_turns(run: RunRecords, frame: Turns) -> RunPicture:
    shown = [one for one in run.let_out if one.t_ns >= frame.start_ns]
    if len(shown) < _LEAST_SHOWN * len(run.let_out):
        return RunPicture(
            _over_time(run),
            "When packets were let out first. Timetables were made anew as the topology changed, and the last one, "
            f"which began at {frame.start_ns / S:.3g} s, was in force for {len(shown):,} of {len(run.let_out):,} "
            "packets, so that no turns are drawn.",
        )
    picture = _by_node(run, frame, shown, ("nodes with turns", "other nodes"), "contention window")
    owners = {one.node for one in frame.own}
    owned = [one for one in shown if one.node in owners]
    kept = _kept(frame, owned)
    said = (
        f"When packets were let out first, under the last timetable, which began at {frame.start_ns / S:.3g} s "
        f"({len(shown):,} of {len(run.let_out):,} packets). Shaded: the turns in which a node transmits packets of its "
        f"own, on the line of that node. Of {len(owned):,} packets of nodes with turns, {kept:,} were let out in a "
        "turn of the origin."
    )
    return RunPicture(picture, said)


def _in_rounds(run: RunRecords, frame: Turns) -> RunPicture:
    kept = _kept(frame, run.let_out)
    bulk = sum(frame.in_window(one.t_ns) for one in run.let_out)
    window = (", and the slots in which bulk is sent", f", {bulk:,} in the slots") if frame.windows else ("", "")
    said = (
        f"When packets were let out first. Shaded: the turn of each node, on its line{window[0]}. Of "
        f"{len(run.let_out):,} packets, {kept:,} were let out in a turn of the origin{window[1]}."
    )
    return RunPicture(_by_node(run, frame, run.let_out, ("packets", ""), "slots of bulk"), said)


def _kept(frame: Turns, let_out: Sequence[LetOut]) -> int:
    """The number of packets that were let out in a span of their origin."""
    spans: dict[int, list[Span]] = defaultdict(list)
    for own in frame.own:
        spans[own.node].append(own)
    return sum(
        any((frame.place_ns(one.t_ns) - own.start_ns) % frame.period_ns < own.length_ns for own in spans[one.node])
        for one in let_out
    )


def _over_time(run: RunRecords) -> Figure:
    figure, (axes,) = canvas(1, width=7.5, height=4.4)
    _scatter(axes, [(one.t_ns / S, one.node) for one in run.let_out], BLUE, "|", None, 16)
    axes.set_xlabel("swarm time [s]")
    axes.set_xlim(0, run.end_s)
    _node_axis(axes, run)
    return figure


def _by_node(run: RunRecords, frame: Turns, shown: Sequence[LetOut], labels: tuple[str, str], window: str) -> Figure:
    """A line for each node, with its own spans shaded. `labels`: of the packets of owners, and of others."""
    figure, (axes,) = canvas(1, width=7.5, height=4.4)
    for index, (start_ns, length_ns) in enumerate(frame.windows):
        label = None if index else window
        axes.axvspan(start_ns / MS, (start_ns + length_ns) / MS, color=_WINDOW_COLOR, zorder=0, label=label)
    for index, own in enumerate(frame.own):
        axes.barh(
            own.node, own.length_ns / MS, left=own.start_ns / MS, height=0.8, color=SHADE, edgecolor=SHADE, zorder=1,
            label=None if index else "the owner's turn",
        )  # fmt: skip
    owners = {own.node for own in frame.own}
    for wanted, label, color, marker in ((True, labels[0], BLUE, "|"), (False, labels[1], DARK, ".")):
        places = [(frame.place_ns(one.t_ns) / MS, one.node) for one in shown if (one.node in owners) == wanted]
        _scatter(axes, places, color, marker, label if label == "packets" else f"packets of {label}", 16)
    _frame_axes(axes, frame.period_ns, frame.period_called)
    _node_axis(axes, run)
    legend_above(figure, axes)
    return figure


def _scatter(
    axes: Axes, places: Sequence[tuple[float, float]], color: str, marker: str, label: str | None, size: int
) -> None:
    if places:
        across, up = zip(*places, strict=True)
        width = 1.2 if marker == "|" else 0
        axes.scatter(across, up, color=color, s=size, marker=marker, zorder=3, label=label, linewidths=width)


def _node_axis(axes: Axes, run: RunRecords) -> None:
    axes.set_ylabel("origin (node id)")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylim(0.2, run.scenario.node_count + 0.8)


def _frame_axes(axes: Axes, period_ns: int, called: str) -> None:
    axes.set_xlabel(f"place in the {called} of {period_ns / MS:.6g} ms [ms]")
    axes.set_xlim(0, period_ns / MS)


def _ns(value_ms: float) -> int:
    return round(value_ms * MS)
