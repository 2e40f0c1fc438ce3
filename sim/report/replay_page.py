"""The page that replays a run in a browser: `replay.html`, one file that asks for nothing else.

The content of the run is JSON within the page (`content` below), and `replay.html` beside this module draws it.
Positions are sampled once a second, in longer or larger runs so rarely that there are at most `_MOST_POINTS` of them.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from emulator.channel.link_budget import heard_m
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    Confirmed,
    Detected,
    FlightModeChanged,
    MissionModeChanged,
    Posed,
    ProcessEnded,
    ProcessStarted,
    RadioFault,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import NodeId, S
from fanet_mw.whole_file import replace_file, writing
from fanet_mw.wire.survivors import person_id
from sim.figures import colors
from sim.observation.event_text import event_text
from sim.recording.drawing import FALLEN_COLOR, HOMEWARD_COLOR, MODE_COLORS, STATUS_COLORS
from sim.results.replay import Replay
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Box, obstacles

REPLAYED: Final = (
    Posed, RoleChanged, FlightModeChanged, MissionModeChanged, Detected, Approaching, Arrived, Confirmed, Refuted,
    Collided, ProcessEnded, ProcessStarted, RadioFault,
)  # fmt: skip
"""The kinds of records that a replay needs: few of a trace, most of which are deliveries."""
_MOST_POINTS: Final = 150_000
"""The greatest number of positions of UAVs in a page, which are about ten bytes each."""
_COLORS: Final = {
    **{name: value for name, value in vars(colors).items() if name.isupper()},
    "MODES": json.dumps(MODE_COLORS), "STATES": json.dumps(STATUS_COLORS), "HOME": HOMEWARD_COLOR,
    "FALLEN": FALLEN_COLOR,
}  # fmt: skip


def write(replay: Replay, path: Path) -> None:
    """Write the page; raises ConfigError if the run has no positions or the file cannot be written."""
    template = files("sim.report").joinpath("replay.html").read_text("utf-8")
    text = json.dumps(content(replay), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    for name, value in _COLORS.items():
        template = template.replace(f"%{name}%", value)
    with writing(path):
        replace_file(path, template.replace("%CONTENT%", text).encode())


def content(replay: Replay) -> dict[str, Any]:
    """All that the page shows, as plain values: metres and seconds, lists by time."""
    scenario = replay.scenario
    nodes = replay.nodes
    ends = [one.t_ns / S for one in replay.records if isinstance(one, Posed)]
    end_s = max(ends, default=scenario.duration_s)
    step_s = max(1, math.ceil(end_s * len(nodes) / _MOST_POINTS))
    return {
        "name": scenario.name,
        "seed": scenario.seed,
        "description": scenario.description,
        "end_s": end_s,
        "step_s": step_s,
        "half_m": scenario.world.area_m / 2,
        "post": list(scenario.ground.at_m),
        "reach_m": round(heard_m(scenario.radio)),
        "persons_from": person_id(0, 0),
        "searches": scenario.mission.survivors > 0 or scenario.mission.search != "none",
        "nodes": nodes,
        "at": _positions(replay, nodes, end_s, step_s),
        "flight": _modes(replay.records, FlightModeChanged, nodes),
        "mission": _modes(replay.records, MissionModeChanged, nodes),
        "role": _modes(replay.records, RoleChanged, nodes),
        "ended": _ended(replay.records),
        **_people(replay),
        "covered": [t_ns / S if t_ns >= 0 else -1 for t_ns in replay.covered_ns.ravel().tolist()],
        "solids": _solids(scenario),
        "no_fly": scenario.world.no_fly_m,
        "events": list(_events(replay.records)),
    }


def _ended(records: Iterable[Record]) -> dict[int, float]:
    """When the process of each UAV ended for good [s]."""
    ended: dict[int, float] = {}
    for one in records:
        if isinstance(one, ProcessEnded) and one.node:
            ended[one.node] = one.t_ns / S
        elif isinstance(one, ProcessStarted):
            ended.pop(one.node, None)
    return ended


def _positions(replay: Replay, nodes: Sequence[NodeId], end_s: float, step_s: int) -> list[list[int]]:
    """For each sample east, north and up of every UAV, one after the other [m]; the last one is of the end."""
    rows = []
    for sample in range(math.ceil(end_s / step_s) + 1):
        at = replay.positions(sample * step_s)
        rows.append([round(value) for node in nodes for value in at[node]])
    return rows


def _modes(records: Sequence[Record], kind: type[Any], nodes: Sequence[NodeId]) -> dict[int, list[list[Any]]]:
    """For each UAV the instants at which a mode changed, each with the other fields of its record."""
    found: dict[int, list[list[Any]]] = {int(node): [] for node in nodes}
    for record in records:
        if type(record) is kind and record.node in found:
            found[record.node].append([round(record.t_ns / S, 2), *record[2:]])
    return found


def _people(replay: Replay) -> dict[str, Any]:
    """The places of the survivors and their states; without places, of a scenario whose map is gone, why."""
    try:
        places = [[round(at.east), round(at.north)] for at in replay.survivors]
    except ConfigError as error:
        return {"survivors": [], "finds": [], "unplaced": str(error)}
    finds = [
        [[round(state.t_ns / S, 2), state.status, state.node] for state in states] for states in replay.finds.values()
    ]
    return {"survivors": places, "finds": finds, "unplaced": ""}


def _solids(scenario: Scenario) -> list[list[list[int]]]:
    """The outlines of buildings; none if the map is gone."""
    if not (scenario.world.buildings or scenario.world.buildings_geojson):
        return []
    try:
        return [_outline(box) for box in obstacles(scenario, np.array(positions(scenario))).boxes]
    except ConfigError:
        return []


def _outline(box: Box) -> list[list[int]]:
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    corners = []
    for along, across in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        x, y = along * box.width / 2, across * box.depth / 2
        corners.append([round(box.east + cos * x - sin * y), round(box.north + sin * x + cos * y)])
    return corners


def _events(records: Sequence[Record]) -> Iterator[list[Any]]:
    """What a person wants to know of, as text, with its instant and UAV."""
    for record in records:
        text = event_text(record)
        if text:
            yield [round(record.t_ns / S, 2), record.node, text]
