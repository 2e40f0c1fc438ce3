"""The page of one run, from the files in its folder: what arrived and when, over which links, in which slots, and what
the mission achieved.
"""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from emulator.pcap_file import NAME as CAPTURE
from emulator.pcap_file import captures
from fanet_mw.whole_file import require_folder
from sim.figures.style import applied, save
from sim.report import air_pictures, finds, mission_pictures, run_pictures, run_rows, slot_pictures
from sim.report.html import Block, Commands, Heading, Picture, Quoted, Text
from sim.report.run_records import SHOWN, RunRecords
from sim.results.file_names import KINDS, PICTURES
from sim.results.printed_summary import clock_sentence
from sim.results.run_folder import RunFolder


def blocks_of_run(folder: Path, out: Path) -> list[Block]:
    """The page of one run; its pictures go to a folder beside the page."""
    found = RunFolder(folder)
    summary, run = found.summary, RunRecords(found.scenario)
    run.read(found.records(*SHOWN))
    links, reports = found.links(), found.agents()
    pictures = out / PICTURES
    require_folder(pictures)
    name = f"{summary['scenario']}-{summary['seed']}"
    blocks: list[Block] = [
        Heading(f"{summary['scenario']}, seed {summary['seed']}, {summary['nodes']} nodes"),
        Quoted(run.scenario.description),
        *_verdict(summary),
        *_slowed(summary),
        *(_finds(run, found) if run.searches else ()),
        Heading("Network", 3),
        run_rows.network(summary),
    ]
    if run.searches:
        blocks += [Heading("Mission", 3), run_rows.mission(summary, confirms=run.scenario.mission.search != "none")]
    captured = captures(folder / CAPTURE)
    air = air_pictures.air_of(run, captured, epoch_unix_ns=summary.get("epoch_unix_ns", 0))
    with applied():
        drawn = {
            "delays": run_pictures.delays(run),
            "delivery": run_pictures.delivery(run),
            "links": run_pictures.links(run, links),
            "slots": slot_pictures.slots(run, reports),
            "air": None if air is None else air_pictures.picture(run, air, links),
        }
        if run.searches:
            drawn |= {
                "mission": mission_pictures.progress(run),
                "waits": mission_pictures.waits(run),
                "tracks": mission_pictures.tracks(run),
            }
        for kind, picture in drawn.items():
            assert kind in KINDS, "whoever replaces a run removes pictures of these kinds alone"
            if picture is not None:
                blocks.append(Heading(_TITLES[kind], 3))
                save(picture.figure, pictures, f"{name}-{kind}")
                blocks.append(Picture(pictures / f"{name}-{kind}.png", picture.caption))
                if kind == "air" and air is not None:
                    blocks += [
                        air_pictures.rows(air),
                        air_pictures.losses(summary),
                        Text(air_pictures.against_dominating_set(run, air)),
                    ]
    if summary["mode"] == "realtime":
        blocks += [Heading("Lateness", 3), run_rows.lateness(summary)]
    return [*blocks, Commands([f"fanet simulate {shlex.quote(str(folder / 'scenario.toml'))}"])]


_TITLES = {
    "delays": "Delays",
    "delivery": "Delivery",
    "links": "Links",
    "slots": "Slots and turns",
    "air": "The air",
    "mission": "Mission over time",
    "waits": "From heard to confirmed",
    "tracks": "Tracks",
}


def _verdict(summary: Mapping[str, Any]) -> list[Block]:
    if summary["valid"]:
        return [Text("The result may be used.")]
    return [Quoted(f"NOT VALID: {'; '.join(summary['invalid_because'])}.")]


def _finds(run: RunRecords, folder: RunFolder) -> list[Block]:
    blocks: list[Block] = []
    known, doubles = finds.without_doubles(finds.with_estimates(finds.finds(run), finds.told(folder)))
    if run.scenario.mission.survivors:
        blocks.append(Heading("Who was found", 3))
        if known:
            blocks.append(finds.found_rows(run, known))
        if run.survivors:
            blocks.append(Text(finds.missed_sentence(run, known, doubles)))
    if run.tracks:
        share, pieces = finds.unsearched(run)
        blocks.append(Heading("What is not searched", 3))
        if pieces:
            blocks.append(finds.unsearched_rows(share, pieces))
        else:
            blocks.append(Text("Nothing: the whole area came within the nominal range of a UAV's phone receiver."))
    return blocks


def _slowed(summary: Mapping[str, Any]) -> list[Block]:
    """How slow the swarm's clock became where the machine could not keep up; nothing if it kept up."""
    if not summary.get("slowed"):
        return []
    return [Text(f"The machine could not keep up{clock_sentence(summary)}.")]
