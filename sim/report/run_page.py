"""The page of one run, from the files in its folder: what arrived and when, over which links, in which slots, and what
the mission achieved.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fanet_mw.scenario import config
from sim.figures.style import applied, save
from sim.report import mission_pictures, run_pictures, run_rows
from sim.report.html import Block, Commands, Heading, Picture, Text
from sim.report.names import KINDS, PICTURES
from sim.report.run_records import SHOWN, RunRecords, agents
from sim.results.file_names import LINKS_FILE, REPORTS_FILE, SCENARIO_FILE, SUMMARY_FILE, TRACE_FILE
from sim.results.printed_summary import clock_sentence
from sim.results.trace_file import read_trace


def is_run(folder: Path) -> bool:
    """True for a folder of `fanet simulate --out` or `fanet launch --out`."""
    return all((folder / name).exists() for name in (SUMMARY_FILE, SCENARIO_FILE, TRACE_FILE))


def blocks_of_run(folder: Path, out: Path) -> list[Block]:
    """The page of one run; its pictures go to a folder beside the page."""
    summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
    scenario = config.load(folder / SCENARIO_FILE)
    run = RunRecords(scenario)
    run.read(read_trace(folder, *SHOWN))
    links, reports = _content(folder / LINKS_FILE, []), agents(_content(folder / REPORTS_FILE, {}))
    pictures = out / PICTURES
    pictures.mkdir(parents=True, exist_ok=True)
    name = f"{summary['scenario']}-{summary['seed']}"
    blocks: list[Block] = [
        Heading(f"{summary['scenario']}, seed {summary['seed']}, {summary['nodes']} nodes"),
        Text(scenario.description),
        Text("The result may be used." if summary["valid"] else f"NOT VALID: {'; '.join(summary['invalid_because'])}."),
        *_slowed(summary),
        Heading("Network", 3),
        run_rows.network(summary),
    ]
    if run.searches:
        blocks += [Heading("Mission", 3), run_rows.mission(summary, confirms=run.scenario.mission.search != "none")]
    for kind, draw in zip(KINDS, _drawings(run, links, reports), strict=True):
        with applied():
            drawn = draw()
            if drawn is not None:
                blocks.append(Heading(_TITLES[kind], 3))
                save(drawn.figure, pictures, f"{name}-{kind}")
                blocks.append(Picture(pictures / f"{name}-{kind}.png", drawn.caption))
    if summary["mode"] == "realtime":
        blocks += [Heading("Lateness", 3), run_rows.lateness(summary)]
    return [*blocks, Commands([f"fanet simulate {folder / 'scenario.toml'}"])]


_TITLES = {
    "delays": "Delays",
    "delivery": "Delivery",
    "links": "Links",
    "slots": "Slots",
    "mission": "Mission over time",
    "tracks": "Tracks",
}


def _drawings(
    run: RunRecords, links: Sequence[Any], reports: dict[int, Any]
) -> Sequence[Callable[[], run_pictures.RunPicture | None]]:
    """What draws each kind of picture, in the order of `KINDS`; a mission's pictures only if the run has one."""
    return (
        partial(run_pictures.delays, run),
        partial(run_pictures.delivery, run),
        partial(run_pictures.links, run, links),
        partial(run_pictures.slots, run, reports),
        *(
            partial(draw, run) if run.searches else _nothing
            for draw in (mission_pictures.progress, mission_pictures.tracks)
        ),
    )


def _nothing() -> None:
    """No picture."""


def _slowed(summary: Mapping[str, Any]) -> list[Block]:
    """How slow the swarm's clock became where the machine could not keep up; nothing if it kept up."""
    if not summary.get("slowed"):
        return []
    return [Text(f"The machine could not keep up{clock_sentence(summary)}.")]


def _content(path: Path, missing: Any) -> Any:  # noqa: ANN401 JSON of a run
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else missing
