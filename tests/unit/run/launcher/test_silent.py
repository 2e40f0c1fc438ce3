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


def test_the_silence_of_a_process_that_is_started_again_counts_from_then_on() -> None:
    begun: list[str] = []
    run = SimpleNamespace(
        processes=SimpleNamespace(restart=begun.append), _collector=SimpleNamespace(begin=begun.append),
        _deaths=SimpleNamespace(note_start=lambda name, **_: begun.append(name)), _now_ns=lambda: 7 * S,
    )  # fmt: skip
    SwarmRun._start_again(cast("Any", run), "agent-3")
    assert begun == ["agent-3"] * 3
