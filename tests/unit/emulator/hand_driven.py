"""A medium driven by hand, for timelines computed by hand; its outputs in a short form."""

from array import array
from typing import NamedTuple

from emulator.medium import Medium
from fanet_mw.bus.messages import Message, Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, NodeId

PAYLOAD = bytes(1024)
NAMES = Topics("test")


class Heard(NamedTuple):
    """One output of the medium."""

    node: int
    message: Message


class Air:
    """A medium, hand-driven."""

    def __init__(self, scenario: Scenario, places_m: list[float]) -> None:
        self.medium = Medium(scenario, "test")
        self.medium.start(0)
        self.place(places_m, 0)
        self._seq = [0] * (len(places_m) + 1)

    def place(self, places_m: list[float], t_ns: int) -> None:
        ids = array("H", range(1, len(places_m) + 1))
        states = array("d", [value for east in places_m for value in (east, 0.0, 50.0, 0.0, 0.0, 0.0)])
        self.medium.receive(NAMES.pose, Poses(t_ns, ids, states), t_ns)

    def send(
        self, src: int, at_ns: int, *, dst: int = BROADCAST, now_ns: int = 0, payload: bytes = PAYLOAD,
        until_ns: int = 0,
    ) -> None:  # fmt: skip
        request = TxRequest(self._seq[src], at_ns, payload, NodeId(dst), wants_status=True, until_ns=until_ns)
        self._seq[src] += 1
        self.medium.receive(NAMES.radio_tx(src), request, now_ns)

    def run(self, until_ns: int = 1000 * MS) -> list[Heard]:
        heard = []
        while (wake_ns := self.medium.next_wake_ns()) is not None and wake_ns <= until_ns:
            self.medium.wake(wake_ns)
            heard += [Heard(node_of(topic), message) for topic, message in self.medium.outbox]
            self.medium.outbox.clear()
        self.medium.stop(until_ns)
        return heard + [Heard(node_of(topic), message) for topic, message in self.medium.outbox]


def receptions(heard: list[Heard]) -> list[tuple[int, int, int]]:
    """(receiver, transmitter, end)."""
    return [(h.node, h.message.src, h.message.end_ns) for h in heard if isinstance(h.message, Reception)]


def statuses(heard: list[Heard]) -> list[tuple[int, TxOutcome, int, int]]:
    """(sender, outcome, end, attempts)."""
    found = [(h.node, h.message) for h in heard if isinstance(h.message, TxStatus)]
    return [(node, message.outcome, message.end_ns, message.attempts) for node, message in found]
