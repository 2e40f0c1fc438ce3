"""An application that writes into the trace what a search tells nobody: whether its UAV plans, and whom it knows.

`scripts/partitions.py --processes` puts it on board of all UAVs. Its records are changes of the mission's mode.
"""

# ruff: noqa: SLF001  (it looks inside the search beside it)
from collections.abc import Mapping
from typing import Any, Final, cast

from agents.mission.applications import PlannedSearch
from agents.mission.searcher import Searcher
from fanet_mw.application import Application, AppPort
from fanet_mw.scenario import Scenario
from fanet_mw.trace import MissionModeChanged
from fanet_mw.units import MS, NodeId
from fanet_mw.wire.survivors import is_person

PLANS: Final = "plans"
FOLLOWS: Final = "follows"
KNOWS: Final = "knows"
FORGETS: Final = "forgets"
STARTS: Final = "starts"
"""Its program begins: it plans nothing, and knows nobody."""
_EVERY_NS: Final = 100 * MS


def plans(search: Searcher, now_ns: int) -> bool:
    """True for a UAV that takes itself for the planner of its part."""
    planner = search._plans._planner
    return planner.plan is not None and planner._leads(now_ns)


def known(search: Searcher) -> set[int]:
    """Whom a UAV knows to be confirmed, of those with a phone."""
    survivors = search._survivors.by_id.items()
    return {number for number, one in survivors if one.confirmed is not None and not is_person(number)}


class Witness(Application):
    """Says so whenever it changes."""

    name: Final = "witness"

    def __init__(self, scenario: Scenario, node: NodeId, options: Mapping[str, Any]) -> None:
        self._next_ns, self._plans, self._known = 0, False, set[int]()

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        applications = cast("Any", port)._onboard._applications
        self._search = next(one._searcher for one in applications if isinstance(one, PlannedSearch))
        self._next_ns = now_ns
        self._say(STARTS, 0, now_ns)

    def next_wake_ns(self) -> int | None:
        return self._next_ns

    def wake(self, now_ns: int) -> None:
        self._next_ns = now_ns + _EVERY_NS
        now_plans, now_known = plans(self._search, now_ns), known(self._search)
        if now_plans != self._plans:
            self._say(PLANS if now_plans else FOLLOWS, 0, now_ns)
        for survivor in sorted(now_known ^ self._known):
            self._say(KNOWS if survivor in now_known else FORGETS, survivor, now_ns)
        self._plans, self._known = now_plans, now_known

    def _say(self, what: str, survivor: int, now_ns: int) -> None:
        self.port.record(MissionModeChanged(now_ns, self.port.node, what, survivor))
