"""Superframe geometry: which instant belongs to which slot. Pure functions of time.

start      start+period
|  slot 0  |  slot 1  | ... |  slot n-1  |  slot 0 ...
|<-usable->g|          each slot ends with a silent guard time
"""

from collections.abc import Mapping
from typing import NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import MS


class Slot(NamedTuple):
    """One occurrence of a slot. A transmission may start at `start` or later, and before `end`."""

    start_ns: int
    end_ns: int


class Superframe(NamedTuple):
    """A period that repeats, divided into slots of equal length; what remains after the last slot is its rest."""

    origin_ns: int
    period_ns: int
    slot_ns: int
    guard_ns: int

    def check(self) -> None:
        """Raise LocalProtocolError when the geometry is impossible."""
        if not 0 < self.slot_ns <= self.period_ns:
            raise LocalProtocolError(f"slot_ns = {self.slot_ns} must be in (0, period_ns = {self.period_ns}]")
        if not 0 <= self.guard_ns < self.slot_ns:
            raise LocalProtocolError(f"guard_ns = {self.guard_ns} must be in [0, slot_ns = {self.slot_ns})")

    @property
    def slots(self) -> int:
        return self.period_ns // self.slot_ns

    def occurrence(self, slot: int, *, not_before_ns: int) -> Slot:
        """The present occurrence of a slot if `not_before_ns` lies in its usable part, otherwise the next one."""
        offset_ns = self.origin_ns + slot * self.slot_ns
        usable_ns = self.slot_ns - self.guard_ns
        periods = (not_before_ns - offset_ns) // self.period_ns
        start_ns = offset_ns + periods * self.period_ns
        if not_before_ns >= start_ns + usable_ns:
            start_ns += self.period_ns
        return Slot(start_ns, start_ns + usable_ns)

    def report(self) -> Mapping[str, object]:
        return {
            "start_ms": self.origin_ns / MS,
            "period_ms": self.period_ns / MS,
            "slot_ms": self.slot_ns / MS,
            "guard_ms": self.guard_ns / MS,
        }
