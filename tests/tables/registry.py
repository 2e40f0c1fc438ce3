"""Which tables of the documents are measured, by what, and how near a new measurement must come.

A table is added by an entry here and its two markers in the document; `scripts/tables NAME` fills it in.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from tests.tables import (
    attacks,
    clusters,
    emulator,
    flight,
    formation_flight,
    installations,
    losses,
    missions,
    models,
    motion,
    plans,
    protocol,
    sensors,
    small_rescues,
)
from tests.tables.markdown import Rows, Tolerance
from tests.validation.ns3_models import fading_table

DOCUMENTS: Final = Path(__file__).parents[2] / "docs"


class Table(NamedTuple):
    """One measured table."""

    document: str
    measure: Callable[[], Rows]
    tolerance: Tolerance
    machine: tuple[str, ...] = ()
    """Columns that depend on the machine; they are written and not compared."""

    @property
    def path(self) -> Path:
        return DOCUMENTS / self.document


TABLES: Final[Mapping[str, Table]] = {
    "ns3": Table("results/against-ns3.md", emulator.against_ns3, Tolerance(absolute=0.005, relative=0.01)),
    "ns3-points": Table("results/against-ns3.md", emulator.points, Tolerance(absolute=0.005, relative=0.01)),
    "ns3-held-out": Table("results/against-ns3.md", emulator.held_out, Tolerance(absolute=0.005, relative=0.01)),
    "ns3-fading": Table("results/against-ns3.md", fading_table, Tolerance(absolute=0.01, relative=0.01)),
    "closed-forms": Table("results/against-ns3.md", emulator.closed_forms, Tolerance(relative=0.01)),
    "error-rates": Table("explanation/channel.md", emulator.error_rates, Tolerance(absolute=0.05)),
    "bounds": Table("explanation/timetable.md", protocol.bounds, Tolerance(absolute=0.002, relative=0.05)),
    "promises": Table("explanation/timetable.md", protocol.promises, Tolerance(absolute=0.02, relative=0.1)),
    "lossy": Table("explanation/lossy-links.md", protocol.lossy, Tolerance(absolute=0.02, relative=0.1)),
    "assumptions": Table("explanation/lossy-links.md", protocol.assumptions, Tolerance(absolute=0.02, relative=0.1)),
    "phones": Table("explanation/finding.md", protocol.phones, Tolerance(absolute=1, relative=0.1)),
    "warnings": Table("explanation/protocol.md", protocol.warnings, Tolerance(absolute=0.1, relative=0.3)),
    "methods-in-motion": Table("results/motion.md", motion.methods, Tolerance(absolute=0.02, relative=0.1)),
    "urgent-in-motion": Table("results/motion.md", motion.urgent, Tolerance(absolute=0.02, relative=0.1)),
    "one-receiver": Table("results/motion.md", motion.one_receiver, Tolerance(absolute=0.02, relative=0.1)),
    "cost-of-rounds": Table(
        "results/motion.md", motion.costs, Tolerance(absolute=0.01, relative=0.1), ("CPU a UAV [ms/s]",)
    ),
    "new-clusters": Table("explanation/clusters.md", clusters.new_clusters, Tolerance(absolute=0.02, relative=0.1)),
    "silent-neighbors": Table(
        "explanation/roles.md", clusters.silent_neighbors, Tolerance(absolute=0.02, relative=0.1)
    ),
    "together": Table("explanation/protocol.md", clusters.together, Tolerance(absolute=0.02, relative=0.1)),
    "relay-rules": Table("explanation/protocol.md", clusters.rules, Tolerance(absolute=0.02, relative=0.1)),
    "plans-of-relays": Table("explanation/planning.md", plans.contending, Tolerance(absolute=0.02, relative=0.1)),
    "wrong-places": Table("explanation/lossy-links.md", plans.wrong_places, Tolerance(absolute=0.02)),
    "goodput": Table("explanation/planning.md", protocol.goodput, Tolerance(absolute=0.02, relative=0.1)),
    "rivals": Table("results/rivals.md", protocol.rivals, Tolerance(absolute=0.02, relative=0.1)),
    "protocol-cost": Table(
        "results/cost.md", protocol.cost, Tolerance(absolute=0.02, relative=0.1), ("CPU per frame [us]",)
    ),
    "message-cost": Table(
        "results/cost.md", protocol.cost_of_messages, Tolerance(absolute=0.02, relative=0.02), ("CPU [us]",)
    ),
    "relay-failure": Table("explanation/roles.md", protocol.dead_relays, Tolerance(absolute=0.1, relative=0.1)),
    "clock-errors": Table("explanation/time.md", protocol.clock_errors, Tolerance(relative=0.2)),
    "flight": Table("results/flight.md", flight.measured, Tolerance(absolute=0.02, relative=0.02)),
    "formation-flight": Table("explanation/formation-flight.md", formation_flight.measured, Tolerance(relative=0.05)),
    "whole-missions": Table("results/missions.md", missions.whole, Tolerance(absolute=0.05, relative=0.02)),
    "losses": Table("results/losses.md", losses.healing, Tolerance()),
    "losses-by-geometry": Table("results/losses.md", losses.by_geometry, Tolerance()),
    "losses-in-a-row": Table("results/losses.md", losses.curve, Tolerance()),
    "flown-on": Table("results/losses.md", losses.to_the_end, Tolerance()),
    "partitions": Table("results/losses.md", losses.partitions, Tolerance()),
    "places": Table("results/missions.md", missions.places, Tolerance(absolute=0.05, relative=0.02)),
    "country-in-small": Table(
        "results/missions.md", missions.country_in_small, Tolerance(absolute=0.05, relative=0.02)
    ),
    "shapes": Table("results/missions.md", missions.shapes, Tolerance(absolute=1, relative=0.05)),
    "engines": Table("results/small-rescues.md", small_rescues.engines, Tolerance(absolute=0.05, relative=0.05)),
    "senses": Table("results/small-rescues.md", small_rescues.senses, Tolerance(absolute=0.05, relative=0.05)),
    "keeping-clear": Table("results/missions.md", missions.keeping_clear, Tolerance(absolute=0.05, relative=0.02)),
    "installations": Table(
        "results/installations.md", installations.installations, Tolerance(relative=0.1), installations.MACHINE
    ),
    "sensor-errors": Table("reference/sensors.md", sensors.errors, Tolerance(absolute=0.1, relative=0.05)),
    "sensor-heights": Table("reference/sensors.md", sensors.heights, Tolerance(absolute=0.1)),
    "models": Table("results/models.md", models.measured, Tolerance(absolute=0.05, relative=0.05)),
    "attacks": Table(
        "results/attacks.md", attacks.over_the_air, Tolerance(absolute=0.02, relative=0.2), attacks.MACHINE
    ),
    "replays": Table("results/attacks.md", attacks.replays, Tolerance()),
    "faults": Table("results/attacks.md", attacks.on_the_bus_and_to_processes, Tolerance(), attacks.MACHINE),
    "clocks": Table("explanation/time.md", protocol.clocks, Tolerance(absolute=0.02, relative=0.2)),
}
