"""What an observer who comes late must be told: the records of a run that still say how things stand."""

from collections.abc import Iterable
from typing import Final

from fanet_mw.trace import (
    Approaching,
    Arrived,
    Confirmed,
    Detected,
    FlightModeChanged,
    MissionModeChanged,
    RadioFault,
    Record,
    Refuted,
    RoleChanged,
)

KINDS: Final = (
    FlightModeChanged, MissionModeChanged, RoleChanged, RadioFault, Detected, Approaching, Arrived, Confirmed, Refuted,
)  # fmt: skip
"""The kinds of records that say it."""
_MOST: Final = 4096
"""Of finds; a foreign program may tell of any number."""


class Standing:
    """Keeps the last mode and role of each UAV, the faults that last, and how far the search for each survivor is."""

    def __init__(self) -> None:
        self._kept: dict[tuple[object, ...], Record] = {}
        self._finds = 0

    def take(self, records: Iterable[Record]) -> None:
        """Records of one process, in the order in which it made them."""
        for record in records:
            match record:
                case FlightModeChanged() | MissionModeChanged() | RoleChanged():
                    self._kept[type(record), record.node] = record
                case RadioFault(active=True):
                    self._kept[RadioFault, record.label] = record
                case RadioFault():
                    self._kept.pop((RadioFault, record.label), None)
                case Detected() | Approaching() | Arrived():
                    self._find((type(record), record.survivor), record)
                case Confirmed() | Refuted():
                    self._find((type(record), record.survivor, record.node, record.t_ns), record)
                case _:
                    pass

    def records(self) -> list[Record]:
        return sorted(self._kept.values(), key=lambda record: record.t_ns)

    def _find(self, key: tuple[object, ...], record: Record) -> None:
        if key not in self._kept and self._finds < _MOST:
            self._finds += 1
            self._kept[key] = record
