"""What befalls receivers, and for how long: as the air records it."""

from typing import Any

import pytest

from fanet_mw.bus.radio_control import Control, Cut, Mishap, MishapKind, Restore
from fanet_mw.units import STILL, Enu, NodeId, S
from sim.world.incidents import Mishaps


def gps(east_m: float | None, *, for_s: int = 0, label: str = "node-1", node: int = 1) -> Mishap:
    """A receiver is wrong by so much, or silent."""
    what, off = (MishapKind.GPS_OFF, STILL) if east_m is None else (MishapKind.GPS, Enu(east_m, 0.0, 0.0))
    return Mishap(label, NodeId(node), what, off, for_s * S)


CRASH = Mishap("node-1", NodeId(1), MishapKind.CRASH, STILL, 0)


@pytest.mark.parametrize(
    ("controls", "off_m", "silent"),
    [
        ([(1, gps(5.0, for_s=2)), (3, gps(9.0, for_s=4))], 9.0, False),
        ([(1, gps(5.0, for_s=2)), (2, gps(None, for_s=9)), (3, gps(7.0, label="b"))], 7.0, True),
        ([(1, gps(5.0)), (4, Restore("node-1")), (4, gps(6.0))], 6.0, False),
        ([(1, gps(5.0)), (4, gps(6.0)), (4, Restore(""))], 0.0, False),
        ([(1, gps(5.0)), (2, Cut("node-1", NodeId(1), 0))], 0.0, False),
        ([(1, gps(5.0)), (2, Cut("node-1", NodeId(4), 0))], 5.0, False),
        ([(1, gps(5.0)), (2, Cut("off", NodeId(1), 0))], 5.0, False),
        ([(1, gps(None)), (2, CRASH)], 0.0, False),
        ([(1, gps(5.0, for_s=4))], 0.0, False),
    ],
)
@pytest.mark.parametrize("step_s", [1, 5])
def test_a_fault_ends_the_one_with_its_label_and_lasts_as_long_as_it_says_itself(
    make_scenario: Any, controls: list[tuple[int, Control]], off_m: float, silent: bool, step_s: int
) -> None:
    mishaps = Mishaps(make_scenario(**{"nodes.count": 3}))
    for at_s, control in controls:
        mishaps.add(control, at_s * S)
    begun = [mishap for now_s in range(0, 6, step_s) for mishap in mishaps.due(now_s * S)]
    assert begun == [control for _, control in controls if isinstance(control, Mishap)]
    assert (mishaps.offset_m[0, 0], mishaps.silent[0]) == (off_m, silent)


def test_a_fault_of_the_post_on_the_ground_ends_the_one_with_its_label_too(make_scenario: Any) -> None:
    mishaps = Mishaps(make_scenario(**{"nodes.count": 3, "ground.at_m": (0.0, -150.0)}))
    mishaps.add(gps(5.0, label="off"), 0)
    mishaps.add(Cut("off", NodeId(4), 0), S)
    for now_s, off_m in enumerate((5.0, 0.0)):
        mishaps.due(now_s * S)
        assert mishaps.offset_m[0, 0] == off_m


def test_what_befalls_a_receiver_that_the_post_on_the_ground_does_not_have_is_passed_over(make_scenario: Any) -> None:
    mishaps = Mishaps(make_scenario(**{"nodes.count": 3, "ground.at_m": (0.0, -150.0)}))
    mishaps.add(gps(5.0, node=4), 0)
    assert [*mishaps.due(S)] == []
    assert not mishaps.offset_m.any()
