"""Which UAVs of the plan are lost, by what this UAV hears and what its neighbors say in their hellos.

A UAV in reach is lost once nobody is known to have heard it for some time, and at once if it falls or its radio is
silent for unusually long. One that may be out of reach is lost only after much longer, because news take a second per
hop. A UAV that finds by its own receiver that another one is lost, or back, floods its roll soon
(docs/explanation/search.md, Whoever is lost).
"""

from collections.abc import Collection
from typing import Final

from agents.mission.navigation.silent_neighbors import SilentNeighbors
from fanet_mw.node.neighbors import neighbor_lifetime_ns
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_messages import LONG_AGO, ROLL_NS, Roll
from fanet_mw.wire.search_plan import Search

_SILENT_NS: Final = 3 * S
"""How long nobody may have heard a UAV until it is lost, at least; with rare hellos as long as a neighbor lasts."""
_NEIGHBOR_NS: Final = 15 * S
"""A UAV was a neighbor until lately if it was heard within this time."""
_AWAY_NS: Final = 40 * S
"""A UAV that was not a neighbor is lost after this time; news from the far end of a swarm are fresher."""
_MUTE_NS: Final = 5 * S
"""A UAV that hears for so long that it is lost takes its own radio for mute: wrong news would be taken back after its
next hello.
"""
MUTE_LEVELS: Final = 7
"""The number of heights at which mute UAVs fly. Places whose numbers differ by less have different ones; UAVs on more
levels would fly too high to hear the others.
"""
_AHEAD: Final = 2
"""A roll is not believed if it states an instant that is so many times `ROLL_NS` ahead of the own clock."""


class RollCall:
    """The UAVs of the plan as one UAV knows them."""

    def __init__(self, node: NodeId, *, hello_interval_s: float, silent: SilentNeighbors | None = None) -> None:
        self._node, self._silent = node, silent
        self._silent_ns = max(_SILENT_NS, neighbor_lifetime_ns(hello_interval_s))
        self._heard: dict[int, int] = {}
        """When each UAV was heard last, by this one or another, in units of `ROLL_NS`."""
        self._neighbor_ns: dict[int, int] = {}
        """The instant at which this UAV itself has heard each other one last."""
        self.lost: dict[int, int] = {}
        """The UAVs that are lost, each with the instant at which this UAV has learned it."""
        self._falls = False
        """Whether this UAV falls."""
        self._called_lost_ns: int | None = None
        """The instant since which every roll that names this UAV has called it lost; None: the last one has not."""
        self._mute_level = 0
        """The level at which this UAV flies if it is mute, from 1 on."""
        self.parted: Collection[int] = ()
        """The UAVs to which no way leads any more, by the radio: they are lost, or in another part of the swarm."""
        self.has_news = False
        """True once this UAV itself has found somebody lost or back, or falls, until all have been told."""

    def on_hello(self, node: int, *, now_ns: int, falls: bool = False) -> None:
        """A neighbor was heard; `falls`: its hello says that it falls from the sky."""
        self._neighbor_ns[node] = now_ns
        self.has_news |= falls != (node in self.lost)  # it falls, or is back
        self._take(node, now_ns // ROLL_NS, lost=falls, now_ns=now_ns)

    def on_roll(self, roll: Roll, plan: Search | None, *, flooded: bool = False, now_ns: int) -> None:
        """Another UAV told its neighbors, or all UAVs (`flooded`), who was heard when."""
        if plan is None or (roll.planner, roll.revision) != (plan.planner, plan.revision):
            return
        if roll.at > now_ns // ROLL_NS + _AHEAD:
            return
        for place, node in enumerate(plan.nodes):
            if node == self._node:
                self._on_called(place, lost=place in roll.lost, now_ns=now_ns)
            elif node and roll.ages[place] < LONG_AGO:
                known, heard, lost = self._heard.get(node), roll.at - roll.ages[place], place in roll.lost
                if known is None or heard > known or lost:  # mostly nothing is new
                    self._take(node, heard, lost=lost, now_ns=now_ns)
        if flooded and roll.lost == self._lost_places(plan):
            self.has_news = False

    def _on_called(self, place: int, *, lost: bool, now_ns: int) -> None:
        if not lost:
            self._called_lost_ns = None
        elif self._called_lost_ns is None:
            self._called_lost_ns, self._mute_level = now_ns, 1 + place % MUTE_LEVELS

    def mute_level(self, now_ns: int) -> int:
        """The level from 1 on at which this UAV flies because it is mute; 0 while others hear it. Levels go by places,
        because mute UAVs do not know of each other, and those that would close the same gap have places near each
        other.
        """
        called_ns = self._called_lost_ns
        return 0 if called_ns is None or now_ns - called_ns < _MUTE_NS else self._mute_level

    def _take(self, node: int, heard: int, *, lost: bool, now_ns: int) -> None:
        known = self._heard.get(node)
        if known is None or heard > known:
            self._heard[node] = heard
            if not lost:
                self.lost.pop(node, None)
        if lost and (known is None or heard >= known):
            self.lost.setdefault(node, now_ns)

    def review(self, plan: Search, *, since_ns: int, falls: bool = False, now_ns: int) -> None:
        """Find who is lost; called several times a second. `since_ns`: from when on others should have been heard;
        `falls`: whether this UAV does.
        """
        self.parted = () if self._silent is None else self._silent.parted(self.lost, now_ns=now_ns)
        self.has_news |= falls and not self._falls
        self._falls = falls
        heard, neighbor_ns, begun = self._heard, self._neighbor_ns, since_ns // ROLL_NS
        least_ns = min(self._silent_ns, _AWAY_NS)
        last_roll = -(-now_ns // ROLL_NS) - 1
        for node in plan.nodes:
            heard_at = heard.get(node, begun)
            if heard_at >= last_roll or node in self.lost or node in (0, self._node):
                continue  # it was heard since the last roll, or is nobody to miss
            silent_ns = now_ns - heard_at * ROLL_NS
            near, gone = now_ns - neighbor_ns.get(node, -_NEIGHBOR_NS) < _NEIGHBOR_NS, False
            if near and self._silent is not None:
                by_others = heard.get(node, 0) > neighbor_ns[node] // ROLL_NS + 1
                gone = not by_others and self._silent.has(NodeId(node), now_ns=now_ns)
                if not gone and silent_ns <= least_ns:
                    continue
                near = gone or self._silent.might_be_heard(NodeId(node), now_ns=now_ns)
            if gone or silent_ns > (self._silent_ns if near else _AWAY_NS):
                self.lost[node] = now_ns
                self.has_news |= near
                heard.setdefault(node, begun)

    def miss(self, node: int, *, now_ns: int) -> None:
        """A UAV is not where this one must hear it by now: it is lost unless others have heard it lately."""
        if node not in self.lost and now_ns - self._heard.get(node, 0) * ROLL_NS > self._silent_ns:
            self.lost[node], self.has_news = now_ns, True

    def roll(self, plan: Search, *, now_ns: int) -> Roll:
        """What this UAV tells its neighbors in its next hello."""
        at = now_ns // ROLL_NS
        heard = {**self._heard, self._node: at}
        ages = tuple(min(LONG_AGO, max(0, at - heard[node])) if node in heard else LONG_AGO for node in plan.nodes)
        return Roll(at, plan.planner, plan.revision, ages, self._lost_places(plan))

    def _lost_places(self, plan: Search) -> frozenset[int]:
        """The places of the plan whose UAVs are lost, or fall."""
        return frozenset(
            place for place, node in enumerate(plan.nodes) if node in self.lost or (node == self._node and self._falls)
        )
