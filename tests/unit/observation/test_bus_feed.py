"""Reports from the bus that a view believes, and those that it refuses."""

import pytest

from sim.observation.bus_feed import makes_sense

SLOTS = {"start_ms": 0.0, "period_ms": 1000.0, "slot_ms": 500.0, "guard_ms": 2.0}
TURNS = {"start_ms": 0.0, "period_ms": 100.0, "contention_ms": 0.0, "turn_ms": 2.0, "own": [1, 4]}


@pytest.mark.parametrize(
    "content",
    [{}, {"waiting": 3, "role": "head", "cluster": 0, "head": 5, "slots": SLOTS}, {"turns": TURNS}, {"slots": None}],
)
def test_what_nodes_say_is_believed(content: dict[str, object]) -> None:
    assert makes_sense(content)


@pytest.mark.parametrize(
    "content",
    [
        {"waiting": "many"}, {"waiting": True}, {"head": [1]}, {"cluster": 0.5}, {"role": 7},
        {"slots": {**SLOTS, "slot_ms": 0.0}}, {"slots": {**SLOTS, "period_ms": 0.0}},
        {"slots": {**SLOTS, "period_ms": 1e9, "slot_ms": 0.01}}, {"turns": {**TURNS, "own": ["x"]}},
        {"turns": {**TURNS, "own": [1] * 5000}}, {"turns": {"own": [1]}},
    ],
)  # fmt: skip
def test_what_would_stop_a_view_is_refused(content: dict[str, object]) -> None:
    assert not makes_sense(content)
