"""An experiment flies an actor of its own in the place of a node, by the names that docs/how-to/extend.md keeps."""

from collections.abc import Mapping
from typing import Any

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.units import NodeId
from sim.results.clocks import true_delays
from sim.results.metrics import summarize
from sim.run.collecting.trace_log import TraceLog
from sim.run.outcome import Outcome
from sim.run.virtual import Observed, actors_of
from sim.scenarios import catalog
from sim.world.mobility.layout import positions

KEYS = ("nodes.count=4", "nodes.layout=line", "duration_s=4", "warmup_s=1", "drain_s=1", "traffic.targets=[1, 2]",
    "traffic.sources=[2, 3]",
)  # fmt: skip


class Listener(Actor):
    """Hears everything at the place of a node, and says nothing."""

    def __init__(self, node: NodeId, swarm: str) -> None:
        super().__init__(f"agent-{node}", (Topics(swarm).radio_rx(node),))
        self._node, self.heard = node, 0

    def start(self, now_ns: int) -> None:
        """Nothing is prepared."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        self.heard += isinstance(message, Reception)

    def next_wake_ns(self) -> int | None:
        return None

    def wake(self, now_ns: int) -> None:
        """Nothing is planned."""

    def report(self) -> Mapping[str, Any]:
        own = {"kind": "agent", "node": self._node, "generated": 0, "bus_malformed": 0, "frames_sent": 0}
        return {**own, "receptions": self.heard, "dropped": {}}


def test_a_listener_takes_the_place_of_the_last_node_and_the_ledger_closes() -> None:
    scenario = catalog.find("flooding", KEYS)
    listener = Listener(NodeId(4), scenario.name)
    actors = [listener if actor.name == listener.name else actor for actor in actors_of(scenario, scenario.name)]
    records = TraceLog(None)
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    reports = {actor.name: actor.report() for actor in actors}
    outcome = Outcome(scenario=scenario, mode="virtual", wall_s=0.0, records=true_delays(records), reports=reports)
    summary = summarize(outcome, trace_sha256="")
    assert listener.heard > 0
    assert (summary["pdr"], summary["valid"]) == (1.0, True), summary["invalid_because"]


def test_the_reports_of_all_nodes_are_read_while_time_passes() -> None:
    scenario = catalog.find("flooding", KEYS)
    assert len(positions(scenario)) == 4
    observed = Observed(scenario)
    observed.host.start()
    sent = []
    for part in (1, 2, 3):
        observed.host.run(scenario.duration_ns * part // 3)
        sent.append(sum(one.report()["frames_sent"] for one in observed.actors if one.name.startswith("agent-")))
    observed.host.stop()
    assert sent[0] < sent[1] < sent[2]
    assert summarize(observed.outcome(wall_s=0.0, cut_short=""), trace_sha256="")["pdr"] == 1.0
