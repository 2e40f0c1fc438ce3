"""Failure detector for cluster heads: the instant from which a head counts as silent to a member of its cluster.

    four hello intervals    in which no packet that the head generated has arrived, and no newer sequence number of it
                            in hellos
    two hello intervals     once the MAC has failed to reach the head

Each further member of the succession waits half an interval longer for the one before it to stand in. Members without
news of the head do not judge it, because they may never have been near it.
"""

from typing import Final

from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.roles.liveness import Liveness
from fanet_mw.units import NodeId

SILENT_HELLOS: Final = 4.0
"""The number of hello intervals after which a head is silent; with a timetable, any neighbor."""
_GIVEN_UP_HELLOS: Final = 2.0
"""The same for a head that the MAC has failed to reach."""
_TURN_HELLOS: Final = 0.5
"""The number of hello intervals that each member of the succession leaves to the one before it."""


class HeadFailureDetector:
    """Tells one member from when on its head is silent."""

    def __init__(self, gradient: Gradient, liveness: Liveness, *, hello_ns: int) -> None:
        self._gradient = gradient
        self._liveness = liveness
        self._hello_ns = hello_ns
        self._unreachable_ns = -1

    def on_unreachable(self, now_ns: int) -> None:
        self._unreachable_ns = now_ns

    def silent_from_ns(self, head: NodeId, *, since_ns: int, before: int) -> int | None:
        """When the head is silent to a member with `before` members ahead of it; None without news since `since_ns`."""
        news_ns = self._gradient.news_ns(head)
        if news_ns is None or news_ns < since_ns:
            return None
        sign_ns = max(news_ns, self._liveness.last_ns(head) or 0)
        hellos = _GIVEN_UP_HELLOS if self._unreachable_ns > sign_ns else SILENT_HELLOS
        return sign_ns + int((hellos + before * _TURN_HELLOS) * self._hello_ns)
