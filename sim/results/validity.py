"""May this result be used? One function gives the reasons why not, in sentences; `valid` and the exit code follow it.

    valid  =  the run ended by itself, no process died, every actor's last report is there, every frame is accounted
              for, and (in real time) each measure of how the machine disturbed the run is within its limit

The limits come from runs that were disturbed on purpose and compared with virtual time: within them the delivery ratio
differs by no more than between two seeds (`tests/benchmarks/disturbed_runs.py`, table in docs/reference/validity.md).
In virtual time nothing disturbs a run.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from sim.run.launcher.processes import describe
from sim.run.outcome import Outcome

LOST: Final = 0.0025
"""The limit for all that the machine took from the air: requests lost on the bus or dropped as too late and turns
missed, each as a share of all requests, and receptions lost on the bus, as a share of those handed over."""
HEARD_LATE: Final = 0.02
"""The limit for receptions handed to their node later than a handover and a lead after the frame's end."""
STALL_MS: Final = 500.0
"""The longest time for which the emulator, the world or the launcher may do nothing: every UAV depends on them."""
UAV_STALL_MS: Final = 1000.0
"""The longest time for which the process of one UAV may do nothing. What it missed counts among `lost` and
`heard_late`, too, which weigh it by the swarm: one UAV of nine that stands still for 300 ms exceeds `lost`."""
SKIPPED_TICKS: Final = 0.02
"""The limit for skipped ticks of the world."""
_PARTS: Final = frozenset({"lost_on_bus", "dropped_late", "missed_turns", "copies_lost"})
_NAMED: Final = 5
"""A sentence lists at most so many names, and gives the number of further ones."""


class Measure(NamedTuple):
    """One measure of how the machine disturbed the run, as a share or in milliseconds."""

    what: str
    value: float
    limit: float
    unit: str = ""
    who: str = ""

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
    parts = {
        "lost_on_bus": Measure(
            "requests lost on the bus", _share(frames["dropped"].get("bus", 0), frames["sent"]), LOST
        ),
        "dropped_late": Measure(
            "requests dropped as too late", _share(frames["dropped"].get("late", 0), frames["sent"]), LOST
        ),
        "missed_turns": Measure(
            "turns missed, of all requests", _share(_sum(agents, "missed_turns"), frames["sent"]), LOST
        ),
        "copies_lost": Measure("receptions lost on the bus", _copies_lost(outcome), LOST),
    }
    together = sum(part.value for part in parts.values())
    ticks, skipped = world.get("ticks", 0), world.get("skipped_ticks", 0)
    return {
        "late_frames": Measure("frames announced too late", late_share, outcome.scenario.radio.late_limit),
        **parts,
        "lost": Measure("lost on the bus, dropped as too late and missed, together", together, LOST),
        "heard_late": Measure("receptions handed over too late", _share(late, heard), HEARD_LATE),
        "stall_ms": _standstill("a service", _stalls(outcome, agents=False), STALL_MS),
        "uav_stall_ms": _standstill("a UAV", _stalls(outcome, agents=True), UAV_STALL_MS),
        "skipped_ticks": Measure("ticks that the world skipped", _share(skipped, ticks + skipped), SKIPPED_TICKS),
    }


def reasons(outcome: Outcome, *, frames: Mapping[str, Any], disturbance: Mapping[str, Measure]) -> list[str]:
    """The reasons why the result may not be used, gravest first, one sentence each; empty when it may."""
    return [
        *_broken(outcome),
        *_incomplete(outcome),
        *_unaccounted(frames),
        *_disturbed(disturbance),
    ]


def _broken(outcome: Outcome) -> Iterator[str]:
    if outcome.aborted is not None:
        yield f"partial result: {outcome.aborted}"
    for code in dict.fromkeys(code for _, code in outcome.ended):
        dead = [name for name, ended in outcome.ended if ended == code]
        yield f"{_named(dead)} ended before the end, with {describe(code)}: {len(dead)}, limit 0"
    for name, why in outcome.absent.items():
        yield f"no report of {name} ({why}); all must report"
    unfinished = [name for name, report in outcome.reports.items() if not report.get("final")]
    if unfinished and outcome.mode == "realtime":
        yield f"no last report of {_named(unfinished)}: {len(unfinished)}, limit 0"


def _incomplete(outcome: Outcome) -> Iterator[str]:
    refused = outcome.heard.get("why", {})
    for why in ("disk", "excess"):
        count = refused.get(f"trace: {why}", 0)
        if count:
            yield f"trace records or puts not kept ({why}): {count}, limit 0"


def _unaccounted(frames: Mapping[str, Any]) -> Iterator[str]:
    if frames["unaccounted"]:
        yield f"frames unaccounted for: {frames['unaccounted']} of {frames['sent']}, limit 0"
    if frames["unasked"]:
        yield f"frames that no node asked for: {frames['unasked']}, limit 0"
    if not frames["closes"] and not frames["unaccounted"] and not frames["unasked"]:
        yield f"the ledger of {frames['sent']} frames does not close"


def _disturbed(disturbance: Mapping[str, Measure]) -> Iterator[str]:
    """Sentences on exceeded limits; that of the sum of losses appears only when no part exceeds its own limit."""
    exceeded = {name: measure for name, measure in disturbance.items() if measure.exceeded}
    if not exceeded.keys().isdisjoint(_PARTS):
        exceeded.pop("lost")
    for measure in exceeded.values():
        yield measure.sentence()


def _named(names: list[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _copies_lost(outcome: Outcome) -> float:
    """The share that never arrived of what the medium handed to the nodes that lived through the run."""
    dead = {name for name, _ in outcome.ended}
    handed = lost = 0
    for node, count in outcome.reports.get("emulator", {}).get("handed", {}).items():
        report = outcome.reports.get(f"agent-{node}")
        if report is not None and f"agent-{node}" not in dead:
            handed += count
            lost += max(0, count - report["receptions"] - (report.get("host") or {}).get("unread_receptions", 0))
    return _share(lost, handed)


def _stalls(outcome: Outcome, *, agents: bool) -> dict[str, float]:
    """The longest standstill [ms] of each UAV, or of each process that serves all of them, by name."""
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
    return sum(report.get(key) or 0 for report in reports)  # a key is absent where the protocol has no turns


def _share(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
