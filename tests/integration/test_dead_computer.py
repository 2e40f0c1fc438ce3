"""Flight controllers bring UAVs home whose computers have died; the others search on: runs in virtual time."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

import sim.run.virtual
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, Planned, Posed
from fanet_mw.units import S
from sim.run.virtual import simulate

DIES_S = 45
KEYS = {
    "nodes.count": 4, "nodes.on_ground": True, "nodes.spacing_m": 15, "nodes.altitude_m": 40, "duration_s": 124,
    "warmup_s": 1, "drain_s": 1, "mission.survivors": 1, "mission.search": "spiral", "mobility.model": "onboard",
    "mobility.return_after_s": 5, "mobility.return_height_m": 70, "world.area_m": 600, "world.base_m": [-350, 0],
    "world.crash": "falls", "radio.range_m": 250, "traffic.arrivals": "none", "nodes.telemetry_hz": 0,
}  # fmt: skip


class Mortal(Actor):
    """An actor that does nothing more from an instant on, as a process that was killed."""

    def __init__(self, actor: Actor, *, dies_ns: int) -> None:
        super().__init__(actor.name, actor.subscriptions)
        self._actor, self._dies_ns = actor, dies_ns

    def start(self, now_ns: int) -> None:
        self._actor.outbox, self._actor.records = self.outbox, self.records
        self._actor.start(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        return True if now_ns >= self._dies_ns else self._actor.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        if now_ns < self._dies_ns:
            self._actor.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        wake_ns = self._actor.next_wake_ns()
        return wake_ns if wake_ns is not None and wake_ns < self._dies_ns else None

    def report(self) -> Mapping[str, Any]:
        return self._actor.report()


@pytest.mark.parametrize("die", [(2,), (2, 3)])
@pytest.mark.slow
def test_who_loses_its_computer_flies_home_by_itself_and_the_others_search_on(
    make_scenario: Callable[..., Scenario], monkeypatch: pytest.MonkeyPatch, die: tuple[int, ...]
) -> None:
    healthy = sim.run.virtual.actors_of

    def actors_of(*args: Any, **named: Any) -> list[Actor]:
        of_swarm = healthy(*args, **named)
        mortals = {f"agent-{node}" for node in die}
        return [Mortal(a, dies_ns=DIES_S * S) if a.name in mortals else a for a in of_swarm]

    monkeypatch.setattr(sim.run.virtual, "actors_of", actors_of)
    records = simulate(make_scenario(**KEYS)).records

    modes = [(r.node, r.mode, r.t_ns / S) for r in records if isinstance(r, FlightModeChanged)]
    assert {node for node, mode, _ in modes if mode == "return"} == {*die}, "who hovers until the plan is not silent"
    for node in die:
        (_, failsafe, _), (_, last, returns_s) = [mode for mode in modes if mode[0] == node][-2:]
        assert (failsafe, last) == ("failsafe", "return")
        assert returns_s == pytest.approx(DIES_S + 5, abs=1.2), "5 s after its last setpoint"
        posed = [r for r in records if isinstance(r, Posed) and r.node == node]
        pad, end = posed[0], posed[-1]
        assert (end.east_m, end.north_m) == pytest.approx((pad.east_m, pad.north_m), abs=6.0), "as well as GPS knows"
        assert end.up_m < 0.5
        dies_at = next(r for r in posed if r.t_ns >= DIES_S * S)
        assert abs(dies_at.east_m - pad.east_m) > 50, "it was on its way"
        assert max(r.up_m for r in posed) == pytest.approx(70 + 3 * (node - 1), abs=2.5), "a height of its own"
    assert not [r for r in records if isinstance(r, Collided)]
    assert {r.revision for r in records if isinstance(r, Planned)} == {1}, "others close ranks, and the plan remains"
