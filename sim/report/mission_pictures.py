"""The pictures of one run's mission: what was achieved over time, and where the UAVs flew."""

from collections.abc import Iterator, Sequence
from typing import Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator, PercentFormatter

from fanet_mw.trace import Approaching, Arrived, Detected, KnownOnGround
from fanet_mw.units import S
from sim.figures.colors import BLUE, DARK, GREEN, ORANGE, PINK, RED
from sim.figures.style import canvas, legend_above
from sim.report.run_pictures import RunPicture, map_canvas
from sim.report.run_records import RunRecords
from sim.results.mission import Confirmations, CoveredCells, covered_over_time

_STEPS: Final = ((Detected, "detected", ORANGE, "o", "-"), (Approaching, "approached", BLUE, "s", "--"),
                 (Arrived, "reached", PINK, "^", "-."))  # fmt: skip

_UNSEARCHED_COLOR: Final = "#e3dccb"
_UNSEARCHED: Final = ListedColormap(["none", _UNSEARCHED_COLOR])
Step = tuple[float, float]
"""An instant [s], and the value from then on."""


def progress(run: RunRecords) -> RunPicture | None:
    """Survivors detected, approached, reached and confirmed, and the area covered, over time."""
    people = run.scenario.mission.survivors
    lines = [line for line in _lines(run) if line[1]] if people else []
    covered = [(t_ns / S, cells.share) for t_ns, cells in covered_over_time(run.scenario, run.tracks.values())]
    if not lines and not covered:
        return None
    panels = [bool(lines), bool(covered)].count(True)
    figure, axes = canvas(1, panels, width=6.5, height=2.6)
    if lines:
        _draw_counts(axes[0], lines, end_s=run.end_s)
        axes[0].axhline(people, color=DARK, linewidth=0.9, linestyle=(0, (1, 2)), label=f"all {people} survivors")
        axes[0].set_ylabel("survivors")
        axes[0].set_ylim(0, people * 1.06)
        axes[0].yaxis.set_major_locator(MaxNLocator(integer=True))
        legend_above(figure, axes[0])
    if covered:
        axes[-1].plot(*zip(*covered, strict=True), color=GREEN)
        axes[-1].set_ylabel("area covered")
        axes[-1].set_ylim(0, 1.05)
        axes[-1].yaxis.set_major_formatter(PercentFormatter(1.0))
    for panel in axes:
        panel.set_xlim(0, run.end_s)
    axes[-1].set_xlabel("time [s]")
    return RunPicture(figure, _progress_said(run, [label for label, _, _, _, _ in lines], covered=bool(covered)))


def _progress_said(run: RunRecords, drawn: Sequence[str], *, covered: bool) -> str:
    said = [f"Number of different survivors {', '.join(drawn)} so far."] if drawn else []
    possible = ["detected", "approached", "reached"]
    if run.scenario.mission.search != "none" and not run.unplaced:
        possible.append("confirmed")
    missing = [label for label in possible if label not in drawn]
    if run.scenario.mission.survivors and missing:
        said.append(f"No survivor was {' or '.join(missing)}.")
    if "confirmed" in drawn:
        said.append("A confirmation far from the true place, or one that was taken back, does not count.")
    if covered:
        said.append("Covered is what came within the nominal range of a UAV's phone receiver.")
    return " ".join(said)


def _lines(run: RunRecords) -> Iterator[tuple[str, list[Step], str, str, str]]:
    """Each line: its name, its steps, color, marker and dashes; the steps are empty if it never happened."""
    for kind, label, color, marker, dash in _STEPS:
        first: dict[int, int] = {}
        for record in run.mission:
            if isinstance(record, kind):
                first.setdefault(record.survivor, record.t_ns)
        steps = [(t_ns / S, float(count)) for count, t_ns in enumerate(sorted(first.values()), 1)]
        yield label, steps, color, marker, dash
    held, confirmed = Confirmations(run.survivors), []
    before = 0
    for record in run.mission:
        held.add(record)
        count = len(held.right())
        if count != before:
            confirmed.append((record.t_ns / S, float(count)))
        before = count
    yield "confirmed", confirmed, GREEN, "D", "-"


def _draw_counts(axes: Axes, lines: Sequence[tuple[str, list[Step], str, str, str]], *, end_s: float) -> None:
    for label, steps, color, marker, dash in lines:
        whole = [(0.0, 0.0), *steps, (end_s, steps[-1][1])]
        axes.plot(*zip(*whole, strict=True), color=color, marker=marker, markersize=3.5, label=label, linestyle=dash,
                  drawstyle="steps-post", markevery=range(1, len(steps) + 1))  # fmt: skip


def waits(run: RunRecords) -> RunPicture | None:
    """How long each survivor waited: from heard to found, and until the post on the ground knew; None where the places
    are not known, and so who was found.
    """
    heard: dict[int, int] = {}
    known: dict[int, list[int]] = {}
    held = Confirmations(run.survivors)
    for record in run.mission:
        held.add(record)
        if isinstance(record, Detected):
            heard.setdefault(record.survivor, record.t_ns)
        elif isinstance(record, KnownOnGround):
            known.setdefault(record.survivor, []).append(record.t_ns)
    if not heard or run.scenario.mission.search == "none" or run.unplaced:
        return None
    confirmed = {one.survivor: one.t_ns for one in held.right()}
    rows = sorted(heard, key=lambda one: (heard[one], one))
    figure, (axes,) = canvas(1, width=6.5, height=1.0 + 0.17 * len(rows))
    for row, survivor in enumerate(rows):
        since_s, until_s = heard[survivor] / S, confirmed.get(survivor, round(run.end_s * S)) / S
        found = survivor in confirmed
        axes.barh(row, until_s - since_s, left=since_s, height=0.62, color=ORANGE if found else "none",
                  edgecolor=ORANGE if found else RED, linestyle="-" if found else "--")  # fmt: skip
        told = [t_ns / S for t_ns in known.get(survivor, ()) if found and t_ns >= confirmed[survivor]]
        if told:
            axes.barh(row, told[0] - until_s, left=until_s, height=0.3, color=BLUE)
            axes.plot(told[0], row, marker="D", markersize=4, color=BLUE)
    handles: list[Artist] = [Patch(color=ORANGE, label="heard, until confirmed")]
    if len(confirmed) < len(rows):
        handles.append(Patch(edgecolor=RED, facecolor="none", linestyle="--", label="not confirmed"))
    if run.scenario.post is not None:
        handles.append(Line2D([], [], color=BLUE, marker="D", label="known at the post"))
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    axes.set_yticks(range(len(rows)), [str(survivor) for survivor in rows])
    axes.invert_yaxis()
    axes.set_ylabel("survivor")
    axes.set_xlabel("time [s]")
    axes.set_xlim(0, run.end_s)
    waited = sorted(confirmed[one] - heard[one] for one in confirmed if one in heard)
    longest = f", at most {waited[-1] / S:.0f} s" if waited else ""
    return RunPicture(
        figure, f"Each survivor from the first reception of the phone to the right confirmation{longest}."
    )


def tracks(run: RunRecords) -> RunPicture | None:
    """The tracks of all UAVs over the area, with survivors and the places at which they were confirmed."""
    if not run.tracks:
        return None
    half = run.scenario.world.area_m / 2
    flown = [[(one.east_m, one.north_m) for one in track] for track in run.tracks.values()]
    figure, axes = map_canvas([(-half, -half), (half, half), *(at for track in flown for at in track)])
    axes.add_patch(Rectangle((-half, -half), 2 * half, 2 * half, fill=False, edgecolor=DARK, linestyle="--",
                             linewidth=0.9, label="area to be searched"))  # fmt: skip
    cells = CoveredCells(run.scenario)
    cells.add(run.flown())
    if not cells.seen.all():
        axes.imshow(~cells.seen, extent=(-half, half, -half, half), origin="lower", cmap=_UNSEARCHED, vmin=0, vmax=1,
                    zorder=0, interpolation="nearest")  # fmt: skip
        axes.add_patch(Rectangle((0, 0), 0, 0, facecolor=_UNSEARCHED_COLOR, label="not searched"))
    axes.add_collection(LineCollection(flown, colors=BLUE, linewidths=0.8, alpha=0.6, label="tracks"))
    ends = [track[-1] for track in flown]
    axes.scatter([at[0] for at in ends], [at[1] for at in ends], s=14, color=BLUE, zorder=3, label="UAVs at the end")
    if run.scenario.ground.at_m:
        east_m, north_m = run.scenario.ground.at_m
        axes.scatter([east_m], [north_m], s=70, marker="s", color=ORANGE, edgecolors=DARK, zorder=4,
                     label="post on the ground")  # fmt: skip
    confirms = run.scenario.mission.search != "none"
    held = Confirmations(run.survivors)
    for record in run.mission:
        held.add(record)
    right, mistaken = held.right(), held.mistaken()
    found = {one.survivor for one in right}
    missed = [at for survivor, at in enumerate(run.survivors, 1) if survivor not in found]
    had = [at for survivor, at in enumerate(run.survivors, 1) if survivor in found]
    for places, label, color, marker in (
        ([(at.east, at.north) for at in had], "survivor, confirmed", DARK, "o"),
        ([(at.east, at.north) for at in missed], "survivor, not confirmed" if confirms else "survivor", RED, "x"),
        ([(one.east_m, one.north_m) for one in right], "place confirmed", GREEN, "+"),
        ([(one.east_m, one.north_m) for one in mistaken], "place confirmed by mistake", PINK, "v"),
    ):
        if places:
            axes.scatter([at[0] for at in places], [at[1] for at in places], s=55, marker=marker, linewidths=1.5,
                         zorder=4, label=label, color=color, facecolors="none" if marker == "o" else color)  # fmt: skip
    for survivor, at in enumerate(run.survivors, 1):
        axes.annotate(str(survivor), (at.east, at.north), textcoords="offset points", xytext=(6, 5), fontsize=8)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    end = f"The true positions of all {len(flown)} UAVs from 0 to {run.end_s:g} s, once a second."
    lost = f" The survivors' places are not known any more ({run.unplaced})." if run.unplaced else ""
    return RunPicture(figure, end + lost)
