"""Whose turn it is: the spans of the superframe or round that belong to nodes, from their reports."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS

MOST_SPANS: Final = 4096
"""The greatest number of slots or turns of a report that is believed."""


class Span(NamedTuple):
    """A span of the superframe that belongs to one node."""

    node: int
    start_ns: int
    length_ns: int


class Turns(NamedTuple):
    """Who may send when, repeated each period from an instant on."""

    start_ns: int
    period_ns: int
    own: Sequence[Span]
    """The spans of nodes; of slots, those of clusters by number, which their heads have."""
    called: str
    """What a span is called: `slot` or `turn`."""
    windows: Sequence[tuple[int, int]] = ()
    """What is left beside the spans, for contention or bulk: starts and lengths."""
    window_called: str = "all contend"
    period_called: str = "superframe"

    def place_ns(self, t_ns: int) -> int:
        """How long after the beginning of its period an instant is."""
        return (t_ns - self.start_ns) % self.period_ns

    def in_window(self, t_ns: int) -> bool:
        place_ns = self.place_ns(t_ns)
        return any(0 <= place_ns - start_ns < length_ns for start_ns, length_ns in self.windows)

    def owners(self, t_ns: int) -> list[int]:
        """The nodes, or the clusters, whose span it is; several where turns are used again far away."""
        place_ns = self.place_ns(t_ns)
        return [one.node for one in self.own if (place_ns - one.start_ns) % self.period_ns < one.length_ns]


def turns(scenario: Scenario, reports: Mapping[int, Mapping[str, Any]]) -> Turns | None:
    """The turns in force by the reports of nodes, or by the rule of rounds; None if nobody owns any."""
    if scenario.routing.protocol == "rounds":
        timing = RoundTiming.of(scenario)
        own = [Span(node, timing.turn_start_ns(node, from_ns=0), timing.turn_ns) for node in scenario.node_ids]
        windows = [(block.slots_start_ns, block.slots * timing.slot_ns) for block in timing.blocks if block.slots]
        return Turns(0, timing.period_ns, own, "turn", windows, "bulk slots", "round")
    turned = {node: report["turns"] for node, report in reports.items() if report.get("turns")}
    if turned:
        newest = max(turned.values(), key=lambda frame: float(frame["start_ms"]))
        in_force = {node: frame for node, frame in turned.items() if _geometry(frame) == _geometry(newest)}
        own = sorted(
            (one for node, frame in in_force.items() for one in spans_of(node, frame)), key=lambda one: one[1:]
        )
        contention_ns = _ns(newest.get("contention_ms", 0.0))
        windows = [(0, contention_ns)] if contention_ns else []
        return Turns(_ns(newest["start_ms"]), _ns(newest["period_ms"]), own, "turn", windows)
    slotted = [report["slots"] for report in reports.values() if report.get("slots")]
    if not slotted:
        return None
    frame = max(slotted, key=lambda one: float(one["start_ms"]))
    period_ns, slot_ns = _ns(frame["period_ms"]), _ns(frame["slot_ms"])
    if period_ns // slot_ns > MOST_SPANS:
        return None
    own = [Span(slot, slot * slot_ns, slot_ns - _ns(frame["guard_ms"])) for slot in range(period_ns // slot_ns)]
    return Turns(_ns(frame["start_ms"]), period_ns, own, "slot")


def _geometry(frame: Mapping[str, Any]) -> tuple[int, ...]:
    """What tells a timetable from an older one, which who hears nothing any more goes on to report."""
    period_ns = _ns(frame["period_ms"])
    return _ns(frame["start_ms"]) % period_ns, period_ns, _ns(frame["turn_ms"]), _ns(frame.get("contention_ms", 0.0))


def spans_of(node: int, frame: Mapping[str, Any]) -> Iterator[Span]:
    for offset in frame["own"]:
        turn_ns = _ns(frame["turn_ms"])
        yield Span(node, (_ns(frame.get("contention_ms", 0.0)) + offset * turn_ns) % _ns(frame["period_ms"]), turn_ns)


def _ns(value_ms: float) -> int:
    return round(value_ms * MS)
