"""What an operator asks of a swarm that runs is held against its scenario first."""

from typing import Any

import pytest

from fanet_mw.bus.radio_control import Control, Cut, Degrade, Mishap, MishapKind, Restore
from fanet_mw.units import STILL, NodeId
from sim.bus.operator_commands import impossible

NINE: dict[str, Any] = {"nodes": {"count": 9}, "ground": {"at_m": []}, "sensors": {"battery_hz": 0.0}}
WITH_POST = {**NINE, "ground": {"at_m": [0.0, -200.0]}}
CRASH = Mishap("x", NodeId(10), MishapKind.CRASH, STILL)
DRAIN = Mishap("x", NodeId(3), MishapKind.BATTERY, STILL)


@pytest.mark.parametrize(
    ("control", "tree", "said"),
    [
        (Cut("x", NodeId(9)), NINE, None),
        (Cut("x", NodeId(10)), NINE, "node 10: the nodes of swarm s are 1 to 9"),
        (Cut("x", NodeId(10)), WITH_POST, None),
        (
            Degrade("x", NodeId(10), NodeId(11), both=True, loss_db=3.0, loss_share=0.0),
            WITH_POST,
            "node 11: the nodes of swarm s are 1 to 10",
        ),
        (CRASH, WITH_POST, "node 10: the UAVs of swarm s are 1 to 9"),
        (DRAIN, NINE, "battery: swarm s has none: its scenario has sensors.battery_hz = 0"),
        (DRAIN, {**NINE, "sensors": {"battery_hz": 1.0}}, None),
        (DRAIN, {**NINE, "world": {"engine": "rotors"}}, None),
        (Restore("x"), NINE, None),
        (Cut("x", NodeId(99)), {}, None),
    ],
)
def test_a_change_that_can_do_nothing_is_refused_as_in_a_file(
    control: Control, tree: dict[str, Any], said: str | None
) -> None:
    """The post could not be cut off, and a battery was said to be drained in swarms that have none."""
    assert impossible(control, tree, "s") == said
