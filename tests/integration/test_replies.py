"""Applications of several nodes that answer the same message, or wake at the same instant: all are heard."""

import pytest
from kit import MakeScenario, slow

from fanet_mw.application import Application, Data, Received
from fanet_mw.units import S
from sim.run.virtual import simulate

COUNT, PORT = 6, 7


class Answering(Application):
    """Node 1 asks once; the others answer everyone, in two messages."""

    name = "answers"
    ports = (PORT,)

    def __init__(self, node: int, got: list[tuple[int, int, bytes]]) -> None:
        self._node, self._got = node, got
        self._asks_ns: int | None = S if node == 1 else None

    def next_wake_ns(self) -> int | None:
        return self._asks_ns

    def wake(self, now_ns: int) -> None:
        self._asks_ns = None
        self.port.send(Data(PORT, b"?"))

    def on_message(self, message: Received, now_ns: int) -> None:
        self._got.append((self._node, message.origin, message.data))
        if message.data == b"?":
            for answer in (b"1", b"2"):
                self.port.send(Data(PORT, answer))


@pytest.mark.parametrize("protocol", ["flooding", *slow("aodv", "direct", "gossip", "counter", "clustered", "rounds")])
def test_all_who_hear_a_question_may_answer_it_at_once(make_scenario: MakeScenario, protocol: str) -> None:
    keys = {"nodes.count": COUNT, "nodes.spacing_m": 50, "traffic.arrivals": "none", "clusters.flooding_period_s": 0.5}
    got: list[tuple[int, int, bytes]] = []
    scenario = make_scenario(**keys, **{"routing.protocol": protocol, "routing.jitter_ms": 40})
    simulate(scenario, applications=lambda node: [Answering(node, got)])
    for node in range(2, COUNT + 1):
        for hearer in {*range(1, COUNT + 1)} - {node}:
            assert [data for by, origin, data in got if (by, origin) == (hearer, node)] == [b"1", b"2"]
