"""The lead and the handover of a swarm of processes whose scenario states neither, fitted to the machine.

    lead       long enough for the pauses of the machine, and for all processes of a processor to have their turn
    handover   where many processes share a processor, so that each wakes less often

The machine is measured for a second before the swarm starts; a pause that comes every ten seconds is mostly missed.
"""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from fanet_mw.hosts.presence import expected_names
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS
from sim.run.launcher.pauses import longest_pause_ns, processors

_MEASURED_S: Final = 1.0
_LEAST_MS: Final = 20
"""Timers and the bus are late by some milliseconds on every machine."""
_MOST_MS: Final = 200
_TURN_MS: Final = 4
"""The lead for each process of a processor: 47 processes on two cores need 100 ms (docs/results/cost.md)."""
_PAUSES: Final = 1.5
"""The lead for each millisecond of the longest pause that was measured: longer ones will come."""
_CROWDED: Final = 8
"""With more processes than this, those of a processor wake together, at every handover."""
_HANDOVER_SHARE: Final = 0.3
"""The handover as a part of the lead, as in `rescue`; an agent's slack is no more than half of the lead."""
_STEP_MS: Final = 10


class Leads(NamedTuple):
    """What was chosen for a run."""

    lead_ms: int
    handover_ms: float
    pause_ms: float
    """The longest pause that was measured."""

    def sentence(self) -> str:
        return (
            f"the scenario states no radio.lead_ms, and this machine pauses for up to {self.pause_ms:.1f} ms: "
            f"lead {self.lead_ms} ms, handover {self.handover_ms:g} ms, which each hop takes longer"
        )


def fitting(*, processes: int, processors: float, pause_ms: float) -> Leads:
    share = processes / processors
    wanted_ms = max(_LEAST_MS, _TURN_MS * share, _PAUSES * pause_ms)
    lead_ms = min(_MOST_MS, _STEP_MS * math.ceil(wanted_ms / _STEP_MS))
    handover_ms = _STEP_MS * round(_HANDOVER_SHARE * lead_ms / _STEP_MS) if share > _CROWDED else 0
    return Leads(lead_ms, handover_ms, pause_ms)


def states_leads(scenario: Scenario) -> bool:
    """True if a scenario states a lead; one of 0 is for virtual time, and states none for processes."""
    radio = scenario.radio
    return bool(radio.lead_ms) and "radio" in scenario.model_fields_set and "lead_ms" in radio.model_fields_set


def fitted(scenario: Scenario, tell: Callable[[str], None]) -> tuple[Scenario, Leads | None]:
    """The scenario for processes on this machine, and what was chosen; None if it states its lead. Takes a second."""
    if states_leads(scenario):
        return scenario, None
    pause_ms = longest_pause_ns(_MEASURED_S) / MS
    leads = fitting(processes=len(expected_names(scenario)), processors=processors(), pause_ms=pause_ms)
    if scenario.radio.handover_ms:
        leads = leads._replace(handover_ms=scenario.radio.handover_ms)
    tell(leads.sentence())
    tree: dict[str, Any] = scenario.model_dump()
    tree["radio"] |= {"lead_ms": leads.lead_ms, "handover_ms": leads.handover_ms}
    return Scenario.model_validate(tree), leads
