"""A UAV's program in virtual time ends when it is told to, and is silent from then on."""

from collections.abc import Mapping
from typing import Any

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.units import S
from sim.run.virtual import StoppableUav


class Ticking(Actor):
    """Acts once a second, and remembers when; each act is a message that was sent."""

    def __init__(self) -> None:
        super().__init__("ticking", ())
        self.at_s: list[int] = []

    def start(self, now_ns: int) -> None:
        """It begins at the first second."""

    def receive(self, topic: str, message: Message, now_ns: int) -> bool:
        return True

    def wake(self, now_ns: int) -> None:
        self.at_s.append(now_ns // S)

    def next_wake_ns(self) -> int:
        return (len(self.at_s) + 1) * S

    def report(self) -> Mapping[str, Any]:
        return {"frames_sent": len(self.at_s), "messages": {"sent": len(self.at_s)}}


def test_a_program_ends_while_it_runs() -> None:
    inner = Ticking()
    uav = StoppableUav(lambda: inner, [(10**18, None)])
    host = VirtualHost([uav])
    host.start()
    host.run(3 * S)
    uav.end_at(3 * S)
    host.nudge(uav)
    host.run(6 * S)
    assert inner.at_s == [1, 2, 3]


def test_what_a_program_has_counted_before_it_was_started_again_is_in_its_report() -> None:
    uav = StoppableUav(Ticking, [(3 * S, 5 * S)])
    host = VirtualHost([uav])
    host.start()
    host.run(6 * S)
    report = uav.report()
    assert uav.alive is not None
    assert report["messages"] == {"sent": 2 + uav.alive.report()["frames_sent"]}
    assert report["frames_sent"] == report["messages"]["sent"]
