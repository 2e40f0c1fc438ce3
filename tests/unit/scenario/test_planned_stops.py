"""When the program of a UAV is stopped, by the faults of its scenario: their labels count as they do on the air."""

from typing import Any

import pytest
from kit import MakeScenario

from fanet_mw.units import S


def stop(at_s: float, **more: Any) -> dict[str, Any]:
    return {"kind": "stop", "node": 3, "at_s": at_s, **more}


@pytest.mark.parametrize(
    ("faults", "stops"),
    [
        ([stop(7, for_s=8)], [(7, 15)]),
        ([stop(20), stop(7, for_s=8)], [(7, 15), (20, None)]),
        ([stop(7), {"kind": "restore", "at_s": 12, "label": "node-3"}], [(7, 12)]),
        ([stop(7, for_s=9), {"kind": "restore", "at_s": 12}], [(7, 12)]),
        ([stop(7, label="a"), {"kind": "restore", "at_s": 12, "label": "node-3"}], [(7, None)]),
        ([stop(7), {"kind": "cut", "node": 3, "at_s": 12}], [(7, 12)]),
        ([stop(7), {"kind": "cut", "node": 2, "at_s": 12}], [(7, None)]),
        ([stop(7, for_s=20), stop(12, for_s=5)], [(7, 17)]),
        ([stop(7, for_s=20), stop(12, for_s=5, label="b")], [(7, 27)]),
        ([stop(7, for_s=8, label="a"), stop(10, label="b")], [(7, None)]),
        ([{**stop(7), "node": 2}], []),
    ],
)
def test_a_program_is_stopped_until_the_last_fault_that_stops_it_ends(
    make_scenario: MakeScenario, faults: list[dict[str, Any]], stops: list[tuple[int, int | None]]
) -> None:
    scenario = make_scenario(**{"nodes.count": 3, "duration_s": 60, "faults": faults})
    found = [(at_ns / S, None if until_ns is None else until_ns / S) for at_ns, until_ns in scenario.planned_stops(3)]
    assert found == stops
