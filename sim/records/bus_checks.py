"""Checks what the collector of a run receives: the border between the bus and the metrics.

    sender -> the kinds it may send -> the nodes and survivors it names (they exist) -> the instant (within the run)

Who really sent a message is not checked: that is the task of the router's access list (docs/how-to/security.md).
"""

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fanet_mw import wire
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.foreign_file import require_plain
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Collided,
    Confirmed,
    FlightModeChanged,
    KnownOnGround,
    MissionModeChanged,
    Posed,
    ProcessEnded,
    ProcessStarted,
    RadioFault,
    Record,
    Refuted,
    Sighted,
)
from fanet_mw.units import S
from fanet_mw.wire.survivors import is_person

_SLACK_NS: Final = 10 * S
"""How far an instant may lie outside the scenario's time, because processes start before it and end after it."""
_FARTHEST_M: Final = 1e7
"""How far from the origin anything can be."""
_DEEPEST: Final = 12
"""The greatest depth of nesting in a report's JSON; that of an application is two below (`fanet_mw/extensions.py`)."""
_MOST_RSSI_MDBM: Final = 400_000
"""The greatest magnitude of the mean RSSI of a link [1/1000 dBm]."""
_SPEAKERS: Final[dict[type[Any], str | None]] = {
    Posed: "world",
    Collided: "world",
    FlightModeChanged: "world",
    RadioFault: "emulator",
    ProcessEnded: None,
    ProcessStarted: None,
}
"""The only actor that may send each of these kinds; None: no actor. All others are sent by the node that they name."""
_ABOUT_NOBODY: Final = (MissionModeChanged, Sighted)
"""The kinds of records in which survivor 0 means none."""
_ABOUT_PERSONS: Final = frozenset({Confirmed, KnownOnGround, Refuted})
"""The kinds of records that may be about a person without a phone, by a number of its own."""
_ABOUT_NODES: Final = ("origin", "other", "reference")
"""The fields of records that hold the id of a node, or 0 for none."""

Count = Annotated[int, Field(ge=0, le=2**53)]
Number = Annotated[float, Field(ge=-1e18, le=1e18)]
Share = Annotated[float, Field(ge=0, le=1)]
Reasons = dict[str, Count]


class _Host(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)
    stall_ms: Number = 0.0
    unread_receptions: Count = 0


class _Checked(BaseModel):
    """The keys that are read must be present; all other keys of a report are kept."""

    model_config = ConfigDict(extra="allow", strict=True)
    final: bool = False
    host: _Host | None = None


class _Frames(_Checked):
    sent: Count
    delivered: Count
    in_flight: Count
    dropped: Reasons


class _Requests(_Checked):
    all: Count
    before_restart: Count


class _Copies(_Checked):
    on_air: Count
    received: Count
    lost: Reasons
    in_flight: Count


class _AirReport(_Checked):
    pdr: Share | None
    busy: Number
    mean_retries: Number | None
    attempt_failure: Share | None
    late_acks: Count
    throughput_mbps: Number


class _Late(_Checked):
    late_frames: Count
    frames: Count
    close_frames: Count = 0
    late_moments: Count = 0
    sum_ms: Number = 0.0
    p50_ms: Number
    p99_ms: Number
    max_ms: Number


class _Emulator(_Checked):
    kind: Literal["emulator"]
    frames: _Frames
    requests: dict[str, _Requests]
    copies: _Copies
    air: _AirReport
    late: _Late
    poses: Count
    controls: Count
    refused: Reasons
    handed: Reasons
    capture_failed: str | None = None


class _SeparationReport(_Checked):
    least_m: Number | None = None
    losses: Count = 0


class _WorldReport(_Checked):
    kind: Literal["world"]
    engine: str
    ticks: Count
    skipped_ticks: Count = 0
    collisions: Count
    crashed: Count = 0
    no_fly_entries: Count = 0
    least_charge: Number | None = None
    separation: _SeparationReport
    malformed: Count


class _ClockReport(_Checked):
    jumps: Count = 0
    lost: Count = 0


class _Agent(_Checked):
    kind: Literal["agent"]
    node: Count
    generated: Count
    bus_malformed: Count
    frames_sent: Count
    receptions: Count
    heard_late: Count = 0
    dropped: Reasons
    missed_turns: Count | None = None
    bound_ms: Number | None = None
    clock: _ClockReport = _ClockReport()
    messages: Reasons = {}


_SHAPES: Final[dict[str, type[_Checked]]] = {"emulator": _Emulator, "world": _WorldReport}


class BusChecks:
    """The checks for one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self._nodes = scenario.node_count
        self._survivors = scenario.mission.survivors
        self._until_ns = scenario.duration_ns + _SLACK_NS
        self.node_of: Mapping[str, int] = {"emulator": 0, "world": 0, **{f"agent-{n}": n for n in scenario.node_ids}}
        """The node of each actor of the swarm, by the actor's name; 0 for an actor that is no node."""

    def record(self, name: str, record: Record) -> str | None:
        """What is wrong with a trace record from the actor of this name; None if nothing is."""
        kind = type(record)
        if kind in _SPEAKERS:
            if _SPEAKERS[kind] != name:
                return "speaker"
            if not 0 <= record.node <= self._nodes:
                return "node"
        elif record.node != self.node_of[name] or not record.node:
            return "speaker" if 1 <= record.node <= self._nodes else "node"
        return self.named(record)

    def named(self, record: Record) -> str | None:
        """What is wrong with the nodes, the survivor, the instant or the place that a record names."""
        kind = type(record)
        if not 0 <= record.node <= self._nodes:
            return "node"
        if not -_SLACK_NS <= record.t_ns <= self._until_ns:
            return "instant"
        if any(not 0 <= getattr(record, field, 0) <= self._nodes for field in _ABOUT_NODES):
            return "node"
        least = 0 if kind in _ABOUT_NOBODY else 1
        survivor = getattr(record, "survivor", 1)
        of_person = kind in _ABOUT_PERSONS and is_person(survivor)
        if not of_person and not least <= survivor <= max(1, self._survivors):
            return "survivor"
        if any(abs(getattr(record, field, 0.0)) > _FARTHEST_M for field in ("east_m", "north_m", "up_m")):
            return "place"
        return None

    def tap(self, tap: MavlinkTap) -> str | None:
        """What is wrong with a tap; only whole frames with an instant within the run can be logged."""
        if not 0 <= tap.t_ns <= self._until_ns:
            return "instant"
        try:
            for _ in wire.frames(tap.data):
                pass
        except MalformedFrameError:
            return "frame"
        return None

    def links(self, stats: LinkStats) -> str | None:
        if not -_SLACK_NS <= stats.t_ns <= self._until_ns:
            return "instant"
        if any(not 1 <= node <= self._nodes for node in stats.ends):
            return "node"
        for row in stats.rows():
            if abs(row.rssi_sum_mdbm) > _MOST_RSSI_MDBM * row.received:
                return "rssi"
        return None

    def report(self, name: str, text: str) -> tuple[dict[str, Any], str | None]:
        """The content of a report, and what is wrong with it; in that case the content is empty."""
        try:
            content = json.loads(text)
            require_plain(content, source=name, finite=True, deepest=_DEEPEST)
        except ConfigError:
            return {}, "a value beyond its bounds"
        except (ValueError, RecursionError):
            return {}, "no JSON"
        shape = _SHAPES.get(name, _Agent)
        try:
            shape.model_validate(content)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            return {}, f"{'.'.join(map(str, first['loc'])) or 'keys'}: {first['msg']}"
        if shape is _Agent and content["node"] != self.node_of[name]:
            return {}, "node: another's"
        return content, None
