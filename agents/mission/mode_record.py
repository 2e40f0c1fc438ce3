"""Records what a searching UAV is doing, in one word, whenever it changes."""

from agents.mission.flight.flight import Flight
from agents.mission.flight.return_home import ReturnHome
from agents.mission.orders import KnownOrders
from agents.mission.outbox import Outbox
from agents.mission.search_formation.formation_place import FormationPlace
from fanet_mw.trace import MissionModeChanged
from fanet_mw.units import NodeId


class ModeRecord:
    """The mode of one UAV: takeoff, wait, deploy, search, respond, errand, return, done, recall, lost_link or land."""

    def __init__(
        self,
        node: NodeId,
        place: FormationPlace,
        flight: Flight,
        return_home: ReturnHome,
        orders: KnownOrders,
        outbox: Outbox,
    ) -> None:
        self._node, self._orders = node, orders
        self._place, self._flight = place, flight
        self._return_home, self._outbox = return_home, outbox
        self._last: tuple[str, int] | None = None
        """The mode that was recorded last, and the survivor to whom the UAV flew then."""

    def review(self, survivor: int | None, now_ns: int) -> None:
        """Record the mode if it has changed; `survivor` is the one to whom this UAV flies, if any."""
        mode = self._mode(survivor, now_ns), survivor or 0
        if self._last != mode:
            self._last = mode
            self._outbox.records.append(MissionModeChanged(now_ns, self._node, *mode))

    def _mode(self, survivor: int | None, now_ns: int) -> str:
        if self._return_home.lands:
            return "land"
        if self._return_home.reason is not None:
            return self._return_home.reason.value
        if self._flight.takes_off:
            return "takeoff"
        if self._orders.errand is not None:
            return "errand"
        if survivor:
            return "respond"
        if self._place.is_taken_up(now_ns):
            return "search"
        return "wait" if self._place.place is None else "deploy"
