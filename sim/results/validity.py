"""Decides whether the result of a run may be used: `reasons` lists, in sentences, everything that speaks against it.

In virtual time the machine cannot disturb a run. The limits come from runs in virtual time that were disturbed on
purpose: within them, the delivery ratio is within 0.015 of that of the undisturbed run
(`tests/benchmarks/disturbed_runs.py`; table in docs/reference/validity.md).
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from fanet_mw.scenario import Scenario
from sim.results.bounds import broken
from sim.results.outcome import UNHEARD, Outcome, described

LOST_LIMIT: Final = 0.0025
"""The greatest sum of four shares: of all transmit requests those lost on the bus, dropped as too late, and turns to
relay that were missed; of all receptions those lost on the bus."""
HEARD_LATE_LIMIT: Final = 0.02
"""The greatest share of receptions that reach their node later than `radio.handover_ms` plus `radio.lead_ms` after the
end of the frame."""
STALL_LIMIT_MS: Final = 500.0
"""The longest time for which the emulator, the world or the launcher may stand still; each UAV depends on them."""
UAV_STALL_LIMIT_MS: Final = 1000.0
"""The same for the process of one UAV. In a small swarm the frames that it costs count first: one UAV of nine that
stands still for 300 ms exceeds the limit of `lost`."""
SKIPPED_TICKS_LIMIT: Final = 0.02
"""The greatest share of the world's ticks that may be skipped."""
_PARTS: Final = frozenset({"lost_on_bus", "dropped_late", "missed_turns", "copies_lost"})
"""The measures whose sum is the measure `lost`."""
_NAMED: Final = 5
"""A sentence names at most this many processes, and gives the number of the others."""


class Measure(NamedTuple):
    """One measure of how the machine disturbed the run, as a share or in milliseconds."""

    what: str
    """The measured quantity, as the subject of a sentence."""
    value: float
    limit: float
    unit: str = ""
    """The unit of value and limit; empty for a share."""
    who: str = ""
    """The process that was measured, in brackets; empty if it was the whole swarm."""

    @property
    def exceeded(self) -> bool:
        return self.value > self.limit

    def sentence(self) -> str:
        if self.unit:
            return f"{self.what}: {self.value:.0f} {self.unit}{self.who}, limit {self.limit:.0f} {self.unit}"
        return f"{self.what}: {self.value:.3%}, limit {self.limit:.3%}"


def measures(outcome: Outcome, *, frames: Mapping[str, Any], late_share: float) -> dict[str, Measure]:
    """The measures of how the machine disturbed the run, by name; empty in virtual time."""
    if outcome.mode == "virtual":
        return {}
    agents = [report for report in outcome.reports.values() if report.get("kind") == "agent"]
    world = outcome.reports.get("world", {})
    late, heard = _sum(agents, "heard_late"), _sum(agents, "receptions")
    requests = frames["sent"] + frames["unasked"]  # what is dropped may be of either
    parts = {
        "lost_on_bus": Measure(
            "requests lost on the bus", _share(frames["dropped"].get("bus", 0), requests), LOST_LIMIT
        ),
        "dropped_late": Measure(
            "requests dropped as too late", _share(frames["dropped"].get("late", 0), requests), LOST_LIMIT
        ),
        "missed_turns": Measure(
            "turns missed, of all requests", _share(_sum(agents, "missed_turns"), requests), LOST_LIMIT
        ),
        "copies_lost": Measure("receptions lost on the bus", _copies_lost(outcome), LOST_LIMIT),
    }
    together = sum(part.value for part in parts.values())
    ticks, skipped = world.get("ticks", 0), world.get("skipped_ticks", 0)
    return {
        "late_frames": Measure("frames announced too late", late_share, outcome.scenario.radio.late_limit),
        **parts,
        "lost": Measure("lost on the bus, dropped as too late and missed, together", together, LOST_LIMIT),
        "heard_late": Measure("receptions handed over too late", _share(late, heard), HEARD_LATE_LIMIT),
        "stall_ms": _standstill("a service", _stalls(outcome, agents=False), STALL_LIMIT_MS),
        "uav_stall_ms": _standstill("a UAV", _stalls(outcome, agents=True), UAV_STALL_LIMIT_MS),
        "skipped_ticks": Measure("ticks that the world skipped", _share(skipped, ticks + skipped), SKIPPED_TICKS_LIMIT),
    }


def reasons(
    outcome: Outcome,
    *,
    frames: Mapping[str, Any],
    copies: Mapping[str, Any],
    bound: Mapping[str, Any],
    clock: Mapping[str, Any],
    disturbance: Mapping[str, Measure],
) -> list[str]:
    """The reasons why the result may not be used, gravest first, one sentence each; empty if it may be used."""
    return [
        *_broken(outcome),
        *_incomplete(outcome),
        *_unaccounted(frames, copies),
        *_promised(bound, clock),
        *_disturbed(disturbance),
    ]


def _broken(outcome: Outcome) -> Iterator[str]:
    if outcome.aborted is not None:
        yield f"partial result: {outcome.aborted}"
    for code in dict.fromkeys(code for _, code in outcome.ended if outcome.mode == "realtime"):
        dead = [name for name, ended in outcome.ended if ended == code]
        yield f"{_named(dead)} ended before the end, with {described(code)}: {len(dead)}, limit 0"
    gone = {f"agent-{node}" for node in outcome.scenario.node_ids if _is_stopped_at_the_end(outcome.scenario, node)}
    for name, why in outcome.absent.items():
        if name not in gone or why != UNHEARD:  # who is stopped at the start never reports
            yield f"no {'last ' if name in outcome.reports else ''}report of {name} ({why}); all must report"
    unfinished = [name for name, report in outcome.reports.items() if not report.get("final") and name not in gone]
    unfinished = [name for name in unfinished if name not in outcome.absent]
    if unfinished and outcome.mode == "realtime":
        yield f"no last report of {_named(unfinished)}: {len(unfinished)}, limit 0"


def _is_stopped_at_the_end(scenario: Scenario, node: int) -> bool:
    """True if a fault ends the program of a node, and nothing starts it again before the end of the run."""
    end_ns = scenario.duration_ns
    return any(at_ns < end_ns and not (until_ns or end_ns) < end_ns for at_ns, until_ns in scenario.planned_stops(node))


def _incomplete(outcome: Outcome) -> Iterator[str]:
    refused = outcome.heard.get("why", {})
    for why in ("disk", "excess"):
        count = refused.get(f"trace: {why}", 0)
        if count:
            yield f"trace records or puts not kept ({why}): {count}, limit 0"


def _unaccounted(frames: Mapping[str, Any], copies: Mapping[str, Any]) -> Iterator[str]:
    if frames["unaccounted"]:
        yield f"frames unaccounted for: {frames['unaccounted']} of {frames['sent']}, limit 0"
    if frames["unasked"]:
        yield f"frames that no node asked for: {frames['unasked']}, limit 0"
    if not frames["closes"] and not frames["unaccounted"] and not frames["unasked"]:
        yield f"the ledger of {frames['sent']} frames does not close"
    if not copies.get("closes", True):
        yield f"the ledger of {copies['on_air']} copies at receivers does not close"


def _promised(bound: Mapping[str, Any], clock: Mapping[str, Any]) -> Iterator[str]:
    if times := broken(bound):
        more = f" ({bound['overtaken']} more were overtaken by a fault)" if bound.get("overtaken") else ""
        yield f"delay bounds that did not hold: {times}, limit 0{more}"
    if wrong := clock.get("beyond_bound"):
        yield f"clocks that were off by more than their nodes stated: {wrong} of {clock['samples']} samples, limit 0"


def _disturbed(disturbance: Mapping[str, Measure]) -> Iterator[str]:
    """One sentence for each exceeded limit; the sum `lost` is left out if one of its parts exceeds the limit alone."""
    exceeded = {name: measure for name, measure in disturbance.items() if measure.exceeded}
    if not exceeded.keys().isdisjoint(_PARTS):
        exceeded.pop("lost")
    for measure in exceeded.values():
        yield measure.sentence()


def _named(names: list[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _copies_lost(outcome: Outcome) -> float:
    """The share of receptions that the emulator sent and that never arrived; not of nodes whose process died, or was
    stopped by a fault: what it had counted until then is lost.
    """
    dead = {name for name, _ in outcome.ended}
    dead |= {f"agent-{node}" for node in outcome.scenario.node_ids if outcome.scenario.planned_stops(node)}
    handed = lost = 0
    for node, count in outcome.reports.get("emulator", {}).get("handed", {}).items():
        report = outcome.reports.get(f"agent-{node}")
        if report is not None and f"agent-{node}" not in dead:
            handed += count
            lost += max(0, count - report["receptions"] - (report.get("host") or {}).get("unread_receptions", 0))
    return _share(lost, handed)


def _stalls(outcome: Outcome, *, agents: bool) -> dict[str, float]:
    """The longest standstill [ms] of each process, by name: of the UAVs' (`agents`), or of all others."""
    stalls = {
        name: (report.get("host") or {}).get("stall_ms", 0.0)
        for name, report in outcome.reports.items()
        if (report.get("kind") == "agent") == agents
    }
    return stalls if agents else {**stalls, "the launcher": outcome.stall_ms}


def _standstill(whose: str, stalls: Mapping[str, float], limit_ms: float) -> Measure:
    longest = max(stalls, key=lambda name: stalls[name], default="none")
    return Measure(f"longest standstill of {whose}", stalls.get(longest, 0.0), limit_ms, "ms", f" ({longest})")


def _sum(reports: list[Mapping[str, Any]], key: str) -> int:
    return sum(report.get(key) or 0 for report in reports)  # only protocols with turns report the turns they missed


def _share(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
