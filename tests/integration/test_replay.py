"""The files of a run are enough to see its mission again."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fanet_mw.bus.messages import Message, Poses
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Detected, Record, Sighted
from fanet_mw.units import S
from sim.results.files import finish
from sim.results.links import LinkTotals
from sim.results.mission import mission
from sim.results.outcome import Outcome
from sim.results.replay import Replay
from sim.run.virtual import actors_of

KEYS = {
    "nodes.count": 5, "nodes.spacing_m": 60, "nodes.altitude_m": 65, "duration_s": 24, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 3, "mission.search": "lines", "mobility.model": "onboard", "world.area_m": 400,
    "sensors.camera_hz": 2, "sensors.camera_fov_deg": 90, "clusters.relay": "counter", "radio.range_m": 250,
    "traffic.arrivals": "none",
}  # fmt: skip


def test_positions_modes_tasks_and_coverage_come_back_from_the_trace_alone(
    make_scenario: Callable[..., Scenario], tmp_path: Path
) -> None:
    scenario = make_scenario(**KEYS)
    records: list[Record] = []
    truth: dict[int, Poses] = {}

    def watch(_: str, message: Message) -> None:
        if isinstance(message, Poses):
            truth[message.t_ns] = message

    actors = actors_of(scenario, scenario.name)
    host = VirtualHost(actors, on_records=records.extend, listeners=[(Topics(scenario.name).pose, watch)])
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    reports = {actor.name: actor.report() for actor in actors}
    outcome = Outcome(scenario, "virtual", 1.0, records, reports, [], LinkTotals())
    summary = finish(outcome, out=tmp_path)

    replay = Replay.read(tmp_path)
    for t_ns, poses in truth.items():
        seen = replay.at(t_ns / S)
        for row, node in enumerate(poses.ids):
            east, north, up = poses.states[6 * row : 6 * row + 3]
            place = seen[node].position
            # 5 m/s2 over half a second either way is 0.6 m off the straight line, and the trace has centimetres
            assert (place.east, place.north, place.up) == pytest.approx((east, north, up), abs=0.8)
    assert mission(replay.scenario, replay.records) == summary["mission"]
    assert summary["mission"]["coverage"] > 0.5
    assert replay.coverage(scenario.duration_ns / S) == pytest.approx(summary["mission"]["coverage"], abs=1e-6)
    assert replay.coverage(0) < replay.coverage(15) <= replay.coverage(24)
    first, last = replay.at(0.0), replay.at(23.0)
    assert {state.mission for state in first.values()} == {""}
    assert {state.mission for state in last.values()} <= {"deploy", "search", "respond"}
    assert {state.flight for state in last.values()} == {"velocity"}
    assert sorted(state.place for state in last.values()) == list(range(5))
    assert {type(r) for r in replay.records} >= {Detected, Sighted}


def test_what_is_no_run_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"summary\.json: cannot be read"):
        Replay.read(tmp_path)
