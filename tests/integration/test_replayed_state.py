"""A replay with a recording knows what an observer of the run knew, whatever the routing protocol."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
from kit import slow

from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError
from fanet_mw.trace import Record
from fanet_mw.units import Enu, S
from sim.cli.app import app
from sim.observation.observer import Observer
from sim.observation.swarm_state import SwarmState
from sim.observation.timeline import Timeline
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

RUNS = {
    "rounds": ("quick", ["routing.protocol=rounds"]),
    "slots": ("quick", []),
    "turns": ("clusters", ["nodes.count=9", "clusters.count=8", "traffic.sources=9", "warmup_s=4", "drain_s=2"]),
}
SECONDS = (4, 7, 8)


class Witness(Observer):
    """An observer that writes down, once it is past some instants, what it knew at the last of its reports."""

    def __init__(self, state: SwarmState) -> None:
        self.state = state
        self.seen: dict[int, dict[str, Any]] = {}
        self.places: dict[int, dict[int, Enu]] = {}

    def take_poses(self, poses: Poses) -> None:
        self.state.take_poses(poses)

    def take_records(self, records: Iterable[Record]) -> None:
        self.state.take_records(records)

    def take_links(self, stats: LinkStats) -> None:
        self.state.take_links(stats)

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None:
        self.state.take_report(name, content, t_ns=t_ns)
        self.seen[t_ns] = known(self.state, t_ns)
        self.places[t_ns] = {node: uav.position for node, uav in self.state.uavs.items()}

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        self.state.take_tap(node, t_ns, data)


def known(state: SwarmState, t_ns: int) -> dict[str, Any]:
    """What is held against each other."""
    metrics = state.metrics()
    return {
        "roles": {node: (uav.role, uav.cluster, uav.head) if uav.head else () for node, uav in state.uavs.items()},
        "modes": {node: (uav.flight, uav.mission, uav.survivor) for node, uav in state.uavs.items()},
        "drops": {node: dict(uav.drops) for node, uav in state.uavs.items()},
        "turns": [state.owners(t_ns + step * S // 50) for step in range(100)],
        "links": sorted(state.link_rows()),
        "queues": {node: report.get("waiting") for node, report in state.reports.items()},
        "charges": {node: uav.charge_percent for node, uav in state.uavs.items()},
        "air": (metrics["airtime_share"], metrics["airtime_lately_share"], metrics["late_share"]),
        "faults": sorted(state.faults),
    }


@pytest.mark.parametrize("name", ["slots", "turns", *slow("rounds")])
def test_what_is_replayed_is_what_was_observed(name: str, tmp_path: Path) -> None:
    base, words = RUNS[name]
    words = [*words, "duration_s=10"]
    scenario = catalog.find(base, words)
    witness = Witness(SwarmState(scenario))
    simulate(scenario, observer=witness)
    out = tmp_path / "run"
    given = ["simulate", base, "--set", *words, "--out", str(out), "--record", str(out / "run.mcap"), "--json"]
    assert app(given, result_action="return_value") == 0
    timeline = Timeline(out)
    for second in (*SECONDS, *reversed(SECONDS)):
        state = timeline.at(second * S)
        replayed, observed = known(state, second * S), witness.seen[second * S]
        for node, at in witness.places[second * S].items():
            assert tuple(state.uavs[node].position) == pytest.approx(at, abs=0.006), "the trace has centimetres"
        for what, value in observed.items():
            assert replayed[what] == value, f"{what} at {second} s"
    assert any(witness.seen[SECONDS[-1] * S]["turns"]), "somebody has a turn"
    assert witness.seen[SECONDS[-1] * S]["air"][1], "the air is busy"


@pytest.mark.parametrize("content", [b"", b"hi", b"no recording" * 10, b"\x89MCAP0\r\n"])
def test_what_is_no_recording_beside_a_run_is_named(tmp_path: Path, content: bytes) -> None:
    keys = ["duration_s=2", "warmup_s=0", "drain_s=0", "mission.survivors=0"]
    finish(simulate(catalog.find("quick", keys)), out=tmp_path / "run")
    (tmp_path / "run" / "other.mcap").write_bytes(content)
    with pytest.raises(ConfigError, match=r"other\.mcap: cannot be read: "):
        Timeline(tmp_path / "run")
