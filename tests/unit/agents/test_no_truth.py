"""No UAV is told what only the world knows: where others truly are, or where it truly is."""

import ast
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from agents.uav import Uav
from fanet_mw.bus.messages import Obstructions, Poses
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S

AGENTS: Final = Path(__file__).resolve().parents[3] / "agents"
MakeScenario = Callable[..., Scenario]


def uav(make_scenario: MakeScenario, **keys: Any) -> Uav:
    scenario = make_scenario(**{"mission.survivors": 2, "mission.search": "lines", "mobility.model": "onboard", **keys})
    return Uav(scenario, NodeId(2), "test", position=Enu(0, 0, 50))


def test_a_uav_hears_its_own_radio_and_its_own_sensors_and_nothing_else(make_scenario: MakeScenario) -> None:
    names = Topics("test")
    subscribed = [topic for topic in uav(make_scenario).subscriptions if topic.startswith("fanet/test/world/")]
    assert subscribed == [names.sensors(NodeId(2))]


def test_poisoned_truth_changes_nothing_that_a_uav_says_or_flies(make_scenario: MakeScenario) -> None:
    poison = [
        Poses(S, array("H", [1, 2]), array("d", [1e6] * 12)),
        Obstructions(S, array("H", [1, 2])),
    ]
    clean, poisoned = uav(make_scenario), uav(make_scenario)
    names = Topics("test")
    for made in (clean, poisoned):
        made.start(0)
    for message in poison:
        poisoned.receive(names.pose, message, S)
    for second in range(1, 20):
        for made in (clean, poisoned):
            made.wake(second * S)
    assert poisoned.outbox == clean.outbox
    assert poisoned.report()["bus_malformed"] == len(poison)


def test_no_module_on_board_names_a_message_of_the_truth_or_the_simulator() -> None:
    for path in sorted(AGENTS.rglob("*.py")):
        for found in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(found, ast.ImportFrom):
                assert not (found.module or "").startswith("sim"), path
                assert not {alias.name for alias in found.names} & {"Poses", "Obstructions"}, path
