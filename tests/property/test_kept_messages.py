"""What senders and receivers of messages say over links that lose is kept: UAVs of two releases exchange messages."""

import pytest
from kept_values import kept
from test_message_pieces import DEAF_PORT, NODES, Network

from fanet_mw.units import MS, NodeId, S


class Noted(Network):
    """Notes what is said when."""

    def put(self, src: NodeId, dst: NodeId, inner: bytes, *, receipts: bool) -> None:
        self.said.append((self.now_ns // MS, src, dst, inner[10:40], len(inner), receipts))
        super().put(src, dst, inner, receipts=receipts)

    said: list[tuple[int, NodeId, NodeId, bytes, int, bool]]


@pytest.mark.parametrize("loss", [0.0, 0.25, 0.6])
def test_what_is_said_of_messages_is_what_it_was_before(loss: float) -> None:
    network = Noted(3, loss=loss)
    network.said = []
    for second in range(12):
        for node in NODES:
            data = network.random.randbytes(network.random.choice((0, 40, 900, 2600)))
            targets = network.random.choice((None, tuple(other for other in NODES if other != node)[:2]))
            network.senders[node].confirmed(
                data, port=network.random.choice((5, 6, DEAF_PORT)), targets=targets, priority=1 + second % 3,
                born_us=network.now_ns // 1000, lifetime_ms=network.random.choice((400, 3000, 9000)),
            )  # fmt: skip
        network.run((second + 1) * S)
    network.run(30 * S)
    counts = [(r.expired, r.not_taken, r.kept_bytes) for r in network.receivers.values()]
    kept(f"messages, {loss}", [counts, network.told.items(), network.got.items(), *network.said])
