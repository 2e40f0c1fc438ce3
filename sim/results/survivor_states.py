"""How far the search for each survivor has come, by the records of a trace in their order."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from fanet_mw.trace import Approaching, Arrived, Confirmed, Detected, PlacedAmong, PlacedInside, Record, Refuted
from fanet_mw.units import Enu
from sim.results.mission import Confirmations

UNHEARD: Final = "not heard"
_STAGES: Final[Mapping[type[Any], str]] = {
    Detected: "detected", Approaching: "approached", Arrived: "reached", PlacedInside: "inside", PlacedAmong: "among",
}  # fmt: skip
_ORDER: Final = (UNHEARD, *_STAGES.values())


class SurvivorState(NamedTuple):
    """The state of one survivor from an instant on."""

    t_ns: int
    status: str
    """`inside`: said to be in a building; `among`: said to be one of several people; `mistaken`: confirmed far from the
    true place; `reopened`: the confirmation was taken back.
    """
    node: int
    """The UAV that brought this about; 0 if there was none."""


class SurvivorStates:
    """The states of all survivors, after the records that were taken in."""

    def __init__(self, truth: Sequence[Enu]) -> None:
        """`truth`: the true places of the survivors, in the order of their ids."""
        self.now = {survivor: SurvivorState(0, UNHEARD, 0) for survivor in range(1, len(truth) + 1)}
        self._held = Confirmations(truth)

    def take(self, record: Record) -> tuple[int, SurvivorState] | None:
        """Take in a record; returns the survivor and the new state, if it changes one."""
        if not isinstance(record, Detected | Approaching | Arrived | PlacedInside | PlacedAmong | Confirmed | Refuted):
            return None
        if record.survivor not in self.now:
            return None
        self._held.add(record)
        before = self.now[record.survivor].status
        status = self._status(record, before)
        if status == before:
            return None
        state = SurvivorState(record.t_ns, status, record.node)
        self.now[record.survivor] = state
        return record.survivor, state

    def count(self, status: str) -> int:
        return sum(state.status == status for state in self.now.values())

    def _status(self, record: Record, before: str) -> str:
        """The status of the survivor of a record; one who is confirmed does not go back to `detected`."""
        if isinstance(record, Confirmed | Refuted):
            if record.survivor in {one.survivor for one in self._held.right()}:
                return "confirmed"
            if record.survivor in {one.survivor for one in self._held.mistaken()}:
                return "mistaken"
            return "reopened" if before in ("confirmed", "mistaken") else before
        stage = _STAGES[type(record)]
        return stage if before in _ORDER and _ORDER.index(stage) > _ORDER.index(before) else before
