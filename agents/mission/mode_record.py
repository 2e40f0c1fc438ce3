"""What a searching UAV does at the moment, in one word, written into the trace whenever it changes."""

from agents.mission.flight.return_home import ReturnHome
from agents.mission.formation.formation_place import FormationPlace
from agents.mission.outbox import Outbox
from fanet_mw.trace import MissionModeChanged
from fanet_mw.units import NodeId


class ModeRecord:
    """The mode of one UAV: wait, deploy, search, respond, return or land."""

    def __init__(self, node: NodeId, place: FormationPlace, return_home: ReturnHome, outbox: Outbox) -> None:
        self._node = node
        self._place, self._return_home, self._outbox = place, return_home, outbox
        self._last: tuple[str, int] | None = None
        """The mode that the trace has, and the survivor to whom the UAV then flew."""

    def review(self, survivor: int | None, now_ns: int) -> None:
        """Write a record if the mode has changed; `survivor` is the one to whom this UAV goes, if any."""
        mode = self._mode(survivor, now_ns), survivor or 0
        if self._last != mode:
            self._last = mode
            self._outbox.records.append(MissionModeChanged(now_ns, self._node, *mode))

    def _mode(self, survivor: int | None, now_ns: int) -> str:
        if self._return_home.lands:
            return "land"
        if self._return_home.leaves:
            return "return"
        if survivor:
            return "respond"
        if self._place.is_taken_up(now_ns):
            return "search"
        return "wait" if self._place.place is None else "deploy"
