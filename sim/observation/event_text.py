"""What a record says to a person, as a sentence whose subject is the UAV; most records say nothing worth reading."""

from collections.abc import Mapping
from typing import Any, Final

from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    Confirmed,
    Detected,
    FlightModeChanged,
    Located,
    MissionModeChanged,
    PlacedAmong,
    PlacedInside,
    ProcessEnded,
    ProcessStarted,
    RadioFault,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.wire.survivors import called

_ABOUT_SURVIVORS: Final[Mapping[type[Any], str]] = {
    Detected: "hears the phone of {}",
    Located: "knows where {} is",
    Approaching: "turns towards {}",
    Arrived: "arrives at {}",
    Confirmed: "confirms {}",
    PlacedInside: "takes {} to be inside a building",
    PlacedAmong: "takes {} to be one of the people there",
    Refuted: "takes back the confirmation of {}",
}


def event_text(record: Record) -> str:
    """The sentence without its subject; empty for what nobody needs to know."""
    if (said := _ABOUT_SURVIVORS.get(type(record))) is not None:
        return said.format(called(record.survivor))  # type: ignore[union-attr]  # these kinds have a survivor
    match record:
        case Collided():
            return f"collides with {f'UAV {record.other}' if record.other else 'the ground or something solid'}"
        case FlightModeChanged() if record.mode in ("fallen", "failsafe"):
            return f"has flight mode {record.mode}"
        case MissionModeChanged() if record.mode in ("return", "done", "lost_link", "lost_position", "land"):
            return f"has mission mode {record.mode}"
        case ProcessEnded():
            return f"process {record.name} ended"
        case ProcessStarted():
            return f"process {record.name} is started again"
        case RadioFault():
            return f"radio fault {record.kind} {record.label} {'begins' if record.active else 'ends'}"
        case RoleChanged() if record.role == "head":
            return f"becomes head of cluster {record.cluster}"
        case _:
            return ""


def event_line(record: Record) -> str:
    """The whole sentence; empty for what nobody needs to know."""
    text = event_text(record)
    return f"UAV {record.node} {text}" if text and record.node else text
