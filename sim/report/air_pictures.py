"""What went over the air, from a run's capture: who sent when and why, and what each cause took of the air."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from emulator.pcap_reader import AirFrame, frames_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Posed
from fanet_mw.units import MS, Enu, S
from fanet_mw.wire import PRIORITIES
from sim.figures.colors import BLUE, DARK, GRAY, GREEN, ORANGE, PINK, RED, SHADE
from sim.figures.style import canvas, legend_above
from sim.observation.air_causes import AirCauses, Cause, transmissions
from sim.report.html import Rows
from sim.report.run_pictures import RunPicture
from sim.report.run_records import RunRecords
from sim.report.run_rows import number, percent
from sim.world.environment.layout import positions

_COLORS: Final = dict(zip(Cause, (BLUE, GREEN, RED, ORANGE, PINK, GRAY), strict=True))
_WHY_COLORS: Final = (DARK, GRAY, SHADE)
"""Reasons of losses, the most frequent first."""
_STEPS: Final = 60
"""The number of steps of the shares over time."""
_FRAMES_SHOWN: Final = 400
"""About so many frames are drawn one by one."""
_INSTANTS: Final = 12
"""The number of instants for which a dominating set is sought."""


class Air:
    """The transmissions of one run."""

    def __init__(self, scenario: Scenario, frames: Iterable[AirFrame]) -> None:
        causes = AirCauses(scenario)
        self.sent = list(transmissions(causes, frames))
        self.times = causes.times
        """How often each packet of an application was sent, by all nodes together."""


def air_of(run: RunRecords, captures: Sequence[Path], *, epoch_unix_ns: int) -> Air | None:
    """What the captures of a run hold; None without one. Raises ConfigError."""
    if not captures:
        return None
    return Air(run.scenario, (one for path in captures for one in frames_of(path, epoch_unix_ns=epoch_unix_ns)))


def picture(run: RunRecords, air: Air, links: Sequence[Mapping[str, Any]]) -> RunPicture | None:
    """Some frames one by one, what was lost and why, and the shares of the air over the whole run."""
    if not air.sent:
        return None
    figure, (by_node, shares, missed) = canvas(3, width=4.4, height=4.0)
    begin_ns, end_ns = run.scenario.traffic_window_ns
    start_ns = (begin_ns + end_ns) // 2
    shown = [one for one in air.sent if one.start_ns >= start_ns and one.cause is not Cause.ACK][:_FRAMES_SHOWN]
    until_ns = max((one.start_ns + one.length_ns for one in shown), default=start_ns + 1)
    least_ms = (until_ns - start_ns) / MS / 400
    for cause in Cause:
        frames = [one for one in shown if one.cause is cause]
        if frames:
            by_node.barh(
                [one.node for one in frames], [max(one.length_ns / MS, least_ms) for one in frames], height=0.9,
                left=[(one.start_ns - start_ns) / MS for one in frames], color=_COLORS[cause], linewidth=0,
            )  # fmt: skip
    by_node.set_xlim(0, (until_ns - start_ns) / MS)
    by_node.set_xlabel(f"time after {start_ns / S:.3g} s [ms]")
    by_node.set_ylabel("sender (node id)")
    _draw_losses(missed, links)
    last_ns = max(one.start_ns for one in air.sent) + 1
    step_ns = -(-last_ns // _STEPS)
    taken: Mapping[Cause, list[float]] = defaultdict(lambda: [0.0] * _STEPS)
    for one in air.sent:
        taken[one.cause][one.start_ns // step_ns] += one.length_ns / step_ns
    used = [cause for cause in Cause if cause in taken]
    shares.stackplot(
        [(step + 0.5) * step_ns / S for step in range(_STEPS)], [taken[cause] for cause in used],
        labels=list(used), colors=[_COLORS[cause] for cause in used],
    )  # fmt: skip
    shares.set_xlim(0, last_ns / S)
    shares.set_ylim(bottom=0)
    shares.set_xlabel("time [s]")
    shares.set_ylabel("airtime of all senders [s per s]")
    legend_above(figure, shares)
    return RunPicture(
        figure,
        f"Left: {len(shown)} frames from the middle of the run, by sender and cause; none is drawn shorter than "
        f"{least_ms:.2g} ms. Middle: the airtime that each cause took over the whole run; senders far apart may send "
        "at the same time, so the sum may be more than 1. Right: the copies of each sender's frames that stations in "
        "range did not receive in the whole run, and why.",
    )


def _draw_losses(axes: Axes, links: Sequence[Mapping[str, Any]]) -> None:
    """The share of the copies of each sender's frames that was lost, by reason."""
    copies, lost = Counter[int](), defaultdict[str, Counter[int]](Counter)
    for link in links:
        copies[link["src"]] += link["copies"]
        for reason, count in link["lost"].items():
            lost[reason][link["src"]] += count
    nodes = sorted(node for node in copies if copies[node])
    before = [0.0] * len(nodes)
    for place, (reason, counts) in enumerate(sorted(lost.items(), key=lambda item: -item[1].total())):
        parts = [counts[node] / copies[node] for node in nodes]
        color = _WHY_COLORS[min(place, len(_WHY_COLORS) - 1)]
        axes.barh(nodes, parts, left=before, height=0.9, color=color, label=reason.replace("_", " "), linewidth=0)
        before = [sum(both) for both in zip(before, parts, strict=True)]
    axes.set_xlim(0, 1.5 * max(before, default=0.0) or 1)
    axes.xaxis.set_major_formatter(PercentFormatter(1, decimals=0))
    axes.set_xlabel("copies lost, of all in range")
    axes.set_ylabel("sender (node id)")
    if lost:
        axes.legend(loc="lower right", fontsize="small")


def rows(air: Air) -> Rows:
    """What each cause took of the air, of packets of applications by priority."""
    whole_ns = sum(one.length_ns for one in air.sent) or 1
    names = {priority: name for name, priority in PRIORITIES.items()}
    counted, took_ns = Counter[tuple[Cause, int | None]](), Counter[tuple[Cause, int | None]]()
    for one in air.sent:
        counted[one.cause, one.priority] += 1
        took_ns[one.cause, one.priority] += one.length_ns
    order = {cause: place for place, cause in enumerate(Cause)}
    found = [
        [
            cause, "-" if priority is None else names.get(priority, str(priority)), f"{count}",
            percent(count / len(air.sent)), percent(took_ns[cause, priority] / whole_ns),
        ]
        for (cause, priority), count in sorted(counted.items(), key=lambda item: (order[item[0][0]], item[0][1] or 0))
    ]  # fmt: skip
    return Rows(["cause", "priority", "frames", "of all frames", "of all airtime"], found)


def losses(summary: Mapping[str, Any]) -> Rows:
    """The copies that stations in range did not receive, and the frames that nobody was sent, by reason."""
    copies, frames = summary["copies"], summary["frames"]
    found = [
        [what, reason.replace("_", " "), f"{count}", percent(count / (whole or 1))]
        for what, lost, whole in (
            ("copies at stations in range", copies["lost"], copies["on_air"]),
            ("frames that no station received", frames["dropped"], frames["sent"]),
        )
        for reason, count in sorted(lost.items(), key=lambda item: -item[1])
    ]
    return Rows(["lost", "why", "how many", "of all"], found)


def against_dominating_set(run: RunRecords, air: Air) -> str:
    """How often each packet to everyone was sent, beside the size of a connected dominating set of the links then."""
    sent = [air.times[name] for name in run.sent if air.times[name] and run.scenario.traffic.destination == "all"]
    least = [size for size in map(len, _dominating_sets(run)) if size]
    if not sent or not least:
        return ""
    mean, needed = sum(sent) / len(sent), sum(least) / len(least)
    return (
        f"Each packet to everyone was sent {number(mean)} times. A greedy connected dominating set of the links has "
        f"{number(needed)} nodes (mean of {len(least)} instants): {mean / needed:.2f} times as many transmissions."
    )


def _dominating_sets(run: RunRecords) -> Iterator[set[int]]:
    starts = dict(enumerate(positions(run.scenario), 1))
    begin_ns, end_ns = run.scenario.traffic_window_ns
    for step in range(_INSTANTS):
        at_ns = begin_ns + (end_ns - begin_ns) * step // _INSTANTS
        moved = {node: Enu(*_at(track, at_ns)[2:]) for node, track in run.tracks.items()}
        places = {**starts, **moved}
        yield greedy_dominating_set(
            {a: {b for b, there in places.items() if b != a and math.dist(here, there) <= run.reach_m(a, b)}
             for a, here in places.items()}
        )  # fmt: skip


def _at(track: Sequence[Posed], at_ns: int) -> Posed:
    return next((one for one in reversed(track) if one.t_ns <= at_ns), track[0])


def greedy_dominating_set(links: Mapping[int, set[int]]) -> set[int]:
    """The node that reaches most others, then always the best beside the set (Guha and Khuller, 1998, algorithm I)."""
    if not links:
        return set()
    chosen = {max(links, key=lambda node: (len(links[node]), -node))}
    covered = chosen | links[next(iter(chosen))]
    while True:
        best = max(covered - chosen, key=lambda node: (len(links[node] - covered), -node), default=None)
        if best is None or not links[best] - covered:
            return chosen
        chosen.add(best)
        covered |= links[best]
