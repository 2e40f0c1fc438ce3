"""Which processes a launcher names while the swarm flies."""

from types import SimpleNamespace
from typing import Any, cast

from fanet_mw.units import S
from sim.run.launcher.swarm import SwarmRun


def test_a_process_that_hangs_is_named_once_and_one_that_has_ended_is_not() -> None:
    said: list[str] = []
    run = SimpleNamespace(
        _collector=SimpleNamespace(silent=lambda for_ns: {"world", "agent-3"} if for_ns == 4 * S else set()),
        processes=SimpleNamespace(names=lambda: ["world", "agent-1"]),
        _silent={}, _tell=said.append, _now_ns=lambda: 7 * S,
    )  # fmt: skip
    for _ in range(4):
        SwarmRun._name_silent(cast("Any", run))
    assert said == ["at 7.0 s no report for 4 s: world"]
