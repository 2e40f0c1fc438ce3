"""The page of one run, from the files in its folder: what arrived and when, over which links, in which slots."""

import json
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.ticker import MaxNLocator

from agents.applications.traffic import targets_of
from fanet_mw.scenario import config
from fanet_mw.scenario.model import Scenario
from fanet_mw.trace import (
    Approaching,
    Arrived,
    BoundStated,
    Delivered,
    Detected,
    Generated,
    LetOut,
    Record,
    RoleChanged,
)
from fanet_mw.units import MS, S
from sim.figures.style import SERIES, applied, canvas, legend_above, save
from sim.report.html import Block, Commands, Heading, Picture, Rows, Text
from sim.report.names import KINDS, PICTURES
from sim.results.file_names import LINKS_FILE, SCENARIO_FILE, SUMMARY_FILE, TRACE_FILE
from sim.results.trace_file import read_trace
from sim.world.mobility.layout import positions

_WINDOWS = 40
"""The number of steps of the delivery ratio over time."""
_SHARES = ListedColormap([colormaps["viridis"](step / 255) for step in range(200)])
"""Colors from dark violet, for links that lose everything, to green; the yellow end of the color map is invisible on
white."""
_SHOWN = (Generated, Delivered, BoundStated, LetOut, RoleChanged, Detected, Approaching, Arrived)
"""The kinds of records that the pictures are drawn from."""
_BLUE, _RED, _GREEN, _PINK, _ORANGE = (look.color for look in SERIES)


def is_run(folder: Path) -> bool:
    """True for a folder of `fanet simulate --out` or `fanet launch --out`."""
    return all((folder / name).exists() for name in (SUMMARY_FILE, SCENARIO_FILE, TRACE_FILE))


@dataclass(slots=True)
class _Story:
    """The content of a trace, as the pictures need it."""

    scenario: Scenario
    sent: dict[tuple[int, int], int] = field(default_factory=dict)
    """The instant at which each packet of the load was generated."""
    bounds: dict[tuple[int, int], int] = field(default_factory=dict)
    delivered: list[Delivered] = field(default_factory=list)
    let_out: list[LetOut] = field(default_factory=list)
    heads: dict[int, int] = field(default_factory=dict)
    """The last head of each node."""
    mission: list[Detected | Approaching | Arrived] = field(default_factory=list)

    def read(self, records: Iterable[Record]) -> None:
        had: set[tuple[int, int, int]] = set()
        for record in records:
            match record:
                case Generated() if record.app == "traffic":
                    self.sent[record.node, record.seq] = record.t_ns
                case Delivered() if (record.node, record.origin, record.seq) not in had:
                    had.add((record.node, record.origin, record.seq))
                    self.delivered.append(record)
                case BoundStated():
                    self.bounds[record.node, record.seq] = record.bound_ns
                case LetOut():
                    self.let_out.append(record)
                case RoleChanged():
                    self.heads[record.node] = record.head
                case Detected() | Approaching() | Arrived():
                    self.mission.append(record)
        targets = {node: set(targets_of(self.scenario, node)) for node in self.scenario.node_ids}
        self.delivered = [
            one for one in self.delivered if (one.origin, one.seq) in self.sent and one.node in targets[one.origin]
        ]

    def targets(self, origin: int) -> Sequence[int]:
        return targets_of(self.scenario, origin)


def blocks_of_run(folder: Path, out: Path) -> list[Block]:
    """The page of one run; its pictures go to a folder beside the page."""
    summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
    tree = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8"))
    story = _Story(config.build(tree, source=str(folder / SCENARIO_FILE)))
    story.read(read_trace(folder, *_SHOWN))
    links_file = folder / LINKS_FILE
    links = json.loads(links_file.read_text(encoding="utf-8")) if links_file.exists() else []
    pictures = out / PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    name = f"{summary['scenario']}-{summary['seed']}"
    blocks: list[Block] = [
        Heading(f"{summary['scenario']}, seed {summary['seed']}, {summary['nodes']} nodes"),
        Text(tree.get("description", "")),
        Text("The result may be used." if summary["valid"] else f"NOT VALID: {'; '.join(summary['invalid_because'])}."),
        _figures_of(summary),
    ]
    drawn = (
        (partial(_delays, story), "Delays of the load; beside them, where the origins stated bounds, those."),
        (partial(_delivery, story), "Delivery ratio by the instant a packet was born, and per receiver."),
        (partial(_map, story, links), "Links by the share of copies received; nodes where they started."),
        (partial(_slots, story), "When packets were let out first, by place in the flooding period."),
        (partial(_mission, story), "What UAVs did for survivors."),
    )
    for kind, (draw, caption) in zip(KINDS, drawn, strict=True):
        with applied():
            figure = draw()
            if figure is not None:
                blocks.append(Heading(kind.capitalize(), 3))
                save(figure, pictures, f"{name}-{kind}")
                blocks.append(Picture(pictures / f"{name}-{kind}.png", caption))
    if summary["mode"] == "realtime":
        late = summary["lateness"]
        blocks.append(Heading("Lateness", 3))
        blocks.append(
            Rows(
                ("late frames", "of", "share", "limit", "p50 [ms]", "p99 [ms]", "worst [ms]"),
                [
                    [
                        f"{late[key]:g}"
                        for key in ("late_frames", "frames", "share", "limit", "p50_ms", "p99_ms", "max_ms")
                    ]
                ],
            )
        )
    return [*blocks, Commands([f"fanet simulate {folder / 'scenario.toml'}"])]


def _figures_of(summary: Mapping[str, Any]) -> Rows:
    """The first figures of the summary, each with what it counts."""
    bound, air = summary["bound"], summary["air"]
    rows = [
        ("delivered / (packets x targets)", _said(summary["pdr"])),
        ("delay, application to application: p50, p95, max [ms]",
         ", ".join(_said(summary["delay_ms"][key]) for key in ("p50", "p95", "max"))),
        ("share of the time that the air is busy", _said(air.get("busy"))),
        ("copies received / copies in range", _said(air.get("pdr"))),
    ]  # fmt: skip
    if bound:
        rows.append(("packets x targets within the bound stated for each", _said(bound["within_share"])))
        rows.append(("greatest bound stated, greatest delay under one [ms]",
                     f"{_said(bound['worst_ms'])}, {_said(bound['observed_max_ms'])}"))  # fmt: skip
    if summary["mission"]["survivors"]:
        mission = summary["mission"]
        rows.append(("survivors detected, approached, reached",
                     ", ".join(str(mission[key]) for key in ("detected", "approached", "reached"))))  # fmt: skip
    return Rows(("quantity", "value"), rows)


def _said(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _steps(axes: Axes, values: Sequence[float], whole: int, label: str, color: str, dash: object) -> None:
    ordered = sorted(values)
    axes.plot(ordered, [(rank + 1) / whole for rank in range(len(ordered))], color=color, label=label, linestyle=dash,
              drawstyle="steps-post")  # fmt: skip


def _delays(story: _Story) -> Any:  # noqa: ANN401 a matplotlib figure, or None
    if not story.delivered:
        return None
    figure, (axes,) = canvas(1, width=6.5)
    whole = sum(len(story.targets(origin)) for origin, _ in story.sent)
    _steps(axes, [one.delay_ns / MS for one in story.delivered], whole, "delay", _BLUE, "-")
    bounds = [bound / MS for name, bound in story.bounds.items() if name in story.sent]
    if bounds:
        _steps(axes, bounds, len(story.sent), "bound stated by the origin", _RED, "--")
    axes.set_xlabel("end-to-end delay [ms]")
    axes.set_ylabel("share of packets x targets")
    axes.set_xlim(left=0)
    axes.set_ylim(0, 1.05)
    legend_above(figure, axes)
    return figure


def _delivery(story: _Story) -> Any:  # noqa: ANN401
    if not story.sent:
        return None
    figure, (over_time, per_node) = canvas(2, width=4.6)
    start_ns, end_ns = story.scenario.traffic_window_ns
    step_ns = max(1, (end_ns - start_ns) // _WINDOWS)
    wanted: Counter[int] = Counter()
    had: Counter[int] = Counter()
    of_node: dict[int, list[int]] = defaultdict(lambda: [0, 0])
    for (origin, _), t_ns in story.sent.items():
        for node in story.targets(origin):
            wanted[(t_ns - start_ns) // step_ns] += 1
            of_node[node][1] += 1
    for one in story.delivered:
        had[(story.sent[one.origin, one.seq] - start_ns) // step_ns] += 1
        of_node[one.node][0] += 1
    steps = sorted(wanted)
    times = [(start_ns + (step + 0.5) * step_ns) / S for step in steps]
    over_time.plot(times, [had[step] / wanted[step] for step in steps], color=_BLUE)
    over_time.set_xlabel("instant at which packets were born [s]")
    nodes = sorted(of_node)
    per_node.bar(nodes, [of_node[node][0] / of_node[node][1] for node in nodes], color=_BLUE)
    per_node.set_xlabel("receiver (node id)")
    per_node.xaxis.set_major_locator(MaxNLocator(integer=True))
    for axes in (over_time, per_node):
        axes.set_ylabel("packet delivery ratio")
        axes.set_ylim(0, 1.05)
    return figure


def _map(story: _Story, links: Sequence[Mapping[str, Any]]) -> Any:  # noqa: ANN401
    if not links:
        return None
    places = positions(story.scenario)
    width_m, height_m = (max(at[axis] for at in places) - min(at[axis] for at in places) for axis in (0, 1))
    shape = min(1.0, max(0.35, height_m / width_m if width_m else 1.0))
    figure, (axes,) = canvas(1, width=6.5, height=1.4 + 4.4 * shape)
    known = [link for link in links if link["copies"]]
    ends = [[places[link[end] - 1][:2] for end in ("src", "dst")] for link in known]
    shares = [link["received"] / link["copies"] for link in known]
    lines = LineCollection(ends, cmap=_SHARES, linewidths=1.3)
    lines.set_array(shares)
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    heads = {head for head in story.heads.values() if head}
    for wanted, label, marker in ((True, "cluster head", "s"), (False, "node", "o")):
        chosen = [places[node - 1] for node in story.scenario.node_ids if (node in heads) == wanted]
        if chosen:
            axes.scatter([at[0] for at in chosen], [at[1] for at in chosen], marker=marker, s=26, zorder=3,
                         color="#222222" if wanted else "#ffffff", edgecolors="#222222", label=label)  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    legend_above(figure, axes)
    figure.colorbar(lines, ax=axes, fraction=0.05, label="copies received / copies in range")
    return figure


def _slots(story: _Story) -> Any:  # noqa: ANN401
    if story.scenario.routing.protocol != "clustered" or not story.let_out:
        return None
    figure, (axes,) = canvas(1, width=6.5, height=4.0)
    period_ns = story.scenario.clusters.period_ns
    axes.scatter([one.t_ns % period_ns / MS for one in story.let_out], [one.node for one in story.let_out], s=14,
                 color=_BLUE, alpha=0.5, linewidths=0)  # fmt: skip
    axes.set_xlabel(f"place in the flooding period of {period_ns / MS:g} ms [ms]")
    axes.set_ylabel("origin (node id)")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0, period_ns / MS)
    return figure


def _mission(story: _Story) -> Any:  # noqa: ANN401
    if not story.mission:
        return None
    figure, (axes,) = canvas(1, width=6.5)
    kinds = ((Detected, "first heard a phone", _ORANGE, "o"), (Approaching, "changed course", _BLUE, "s"),
             (Arrived, "arrived", _GREEN, "^"))  # fmt: skip
    for kind, label, color, marker in kinds:
        first: dict[int, int] = {}
        for record in story.mission:
            if isinstance(record, kind):
                first.setdefault(record.node, record.t_ns)
        times = sorted(t_ns / S for t_ns in first.values())
        axes.plot(times, range(1, len(times) + 1), color=color, marker=marker, markersize=3, label=label,
                  drawstyle="steps-post")  # fmt: skip
    axes.set_xlabel("time [s]")
    axes.set_xlim(0, story.scenario.duration_s)
    axes.set_ylabel("UAVs that have done so")
    axes.set_ylim(bottom=0)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    legend_above(figure, axes)
    return figure
