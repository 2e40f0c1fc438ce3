"""The radio contract, run against every radio: what a node may rely on, whatever is behind its topics.

Three nodes in range of each other; the same requests go to the emulated medium in virtual time and to real sockets.
"""

import asyncio
import socket
import time
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from emulator import late_requests
from emulator.medium import Medium
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.radios.udp import MOST_ADDRESSES, MOVED_NS, TOO_LATE_NS, Datagram, DatagramKind, UdpRadio
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, MS, NodeId
from sim.world.world import WorldActor

NODES = (NodeId(1), NodeId(2), NodeId(3))
UNTIL_NS = 700 * MS
Requests = list[tuple[int, TxRequest]]
Heard = Mapping[int, list[Reception | TxStatus]]
SCENARIO = config.build(
    {
        "name": "radios", "duration_s": 2, "clusters": {"count": 1},
        "nodes": {"count": 3, "layout": "line", "spacing_m": 50, "telemetry_hz": 0},
    }
)  # fmt: skip


class Asker(Actor):
    """Makes all requests at once."""

    def __init__(self, requests: Requests) -> None:
        super().__init__("asker", ())
        self._requests = requests

    def start(self, now_ns: int) -> None:
        self.outbox += [(Topics("radios").radio_tx(node), request) for node, request in self._requests]

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        raise AssertionError("it hears nothing")

    def wake(self, now_ns: int) -> None:
        raise AssertionError("it never wakes")

    def next_wake_ns(self) -> int | None:
        return None


def emulated(requests: Requests) -> Heard:
    names = Topics("radios")
    heard: dict[int, list[Reception | TxStatus]] = {node: [] for node in NODES}

    def note(topic: str, message: Message) -> None:
        if isinstance(message, Reception | TxStatus):
            heard[node_of(topic)].append(message)

    actors = [WorldActor(SCENARIO, "radios"), Medium(SCENARIO, "radios"), Asker(requests)]
    host = VirtualHost(actors, listeners=[(names.radio_rx("*"), note)])
    host.start()
    host.run(UNTIL_NS)
    return heard


def over_sockets(requests: Requests) -> Heard:
    return asyncio.run(_over_sockets(requests))


def free_port() -> int:
    """A port that nobody on this machine uses: other tests of this kind may run beside this one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.7.0.9", 0))
        port: int = probe.getsockname()[1]
        return port


async def _over_sockets(requests: Requests) -> Heard:
    loop = asyncio.get_running_loop()
    began = loop.time()
    heard: dict[int, list[Reception | TxStatus]] = {node: [] for node in NODES}
    port = free_port()
    radios = {
        node: UdpRadio(
            node, address=f"127.7.0.{node}", broadcast="127.255.255.255", port=port,
            max_frame_bytes=SCENARIO.radio.max_frame_bytes, now_ns=lambda: round((loop.time() - began) * 1e9),
            on_message=heard[node].append,
        )
        for node in NODES
    }  # fmt: skip
    try:
        for radio in radios.values():
            await radio.open()
        began = loop.time()
        for node, request in requests:
            radios[NodeId(node)].request(request)
        await asyncio.sleep(UNTIL_NS / 1e9)
    finally:
        for radio in radios.values():
            radio.close()
    return heard


@pytest.fixture(params=[emulated, over_sockets], ids=["emulated", "udp"])
def run(request: pytest.FixtureRequest) -> Callable[[Requests], Heard]:
    made: Callable[[Requests], Heard] = request.param
    return made


def request_of(seq: int, *, at_ms: int, dst: NodeId = BROADCAST, size: int = 200, status: bool = False) -> TxRequest:
    return TxRequest(seq, at_ms * MS, bytes([seq % 256]) * size, dst, status)


def test_a_frame_is_not_begun_from_its_end_on(run: Callable[[Requests], Heard]) -> None:
    heard = run([(1, request_of(0, at_ms=100, status=True)._replace(until_ns=100 * MS)), (1, request_of(1, at_ms=150))])
    assert [reception.frame[0] for reception in receptions(heard, 2)] == [1]
    assert [status.outcome in (TxOutcome.LIFETIME, TxOutcome.LATE) for status in statuses(heard, 1)] == [True]


def receptions(heard: Heard, node: int) -> list[Reception]:
    return [message for message in heard[node] if isinstance(message, Reception)]


def statuses(heard: Heard, node: int) -> list[TxStatus]:
    return [message for message in heard[node] if isinstance(message, TxStatus)]


def test_a_broadcast_reaches_everyone_else_unchanged_and_not_before_its_instant(
    run: Callable[[Requests], Heard],
) -> None:
    began_ns = time.monotonic_ns()
    heard = run([(1, request_of(0, at_ms=100, size=2268))])
    took_ns = time.monotonic_ns() - began_ns
    assert receptions(heard, 1) == []
    for node in (2, 3):
        (reception,) = receptions(heard, node)
        assert reception.frame == bytes(2268)
        assert reception.src == 1
        assert 100 * MS <= reception.end_ns <= max(250 * MS, took_ns)


def test_a_unicast_reaches_its_destination_alone_and_is_acknowledged(run: Callable[[Requests], Heard]) -> None:
    heard = run([(1, request_of(0, at_ms=10)), (3, request_of(0, at_ms=200, dst=NodeId(1), status=True))])
    assert [r.src for r in receptions(heard, 1)] == [3]
    assert [r.src for r in receptions(heard, 2)] == [1]
    (status,) = statuses(heard, 3)
    assert (status.seq, status.outcome) == (0, TxOutcome.ACKED)
    assert status.attempts >= 1


def test_the_first_unicast_to_a_node_that_was_never_heard_arrives_too(run: Callable[[Requests], Heard]) -> None:
    heard = run([(1, request_of(7, at_ms=20, dst=NodeId(2), status=True))])
    assert len(receptions(heard, 2)) == 1
    assert receptions(heard, 3) == []
    assert [s.outcome for s in statuses(heard, 1)] == [TxOutcome.ACKED]


def test_a_status_comes_only_when_asked_for_and_tells_that_a_broadcast_went_out(
    run: Callable[[Requests], Heard],
) -> None:
    heard = run([(1, request_of(0, at_ms=10)), (1, request_of(1, at_ms=60, status=True))])
    assert [(s.seq, s.outcome) for s in statuses(heard, 1)] == [(1, TxOutcome.SENT)]


def test_requests_go_in_the_order_of_their_instants_each_once(run: Callable[[Requests], Heard]) -> None:
    heard = run([(1, request_of(seq, at_ms=20 + 30 * (9 - seq))) for seq in range(10)])
    assert [r.frame[0] for r in receptions(heard, 2)] == list(reversed(range(10)))


def test_a_frame_that_is_too_large_is_told_and_not_sent(run: Callable[[Requests], Heard]) -> None:
    heard = run([(1, request_of(0, at_ms=10, size=2305, status=True))])
    assert receptions(heard, 2) == []
    (status,) = statuses(heard, 1)
    assert status.outcome is TxOutcome.REFUSED


# --- what only a real radio has ---------------------------------------------------------------------------------


async def test_a_unicast_that_nobody_acknowledges_is_given_up_and_hostile_datagrams_are_counted() -> None:
    told: list[Reception | TxStatus] = []
    port = free_port()
    radio = UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=port, max_frame_bytes=300,
        now_ns=lambda: 0, on_message=told.append,
    )  # fmt: skip
    await radio.open()
    try:
        radio.request(request_of(4, at_ms=0, dst=NodeId(2), status=True))
        here = ("127.7.0.9", port)
        good = Datagram(DatagramKind.FRAME, NodeId(3), BROADCAST, 1, b"x").encode()
        for data in (
            b"",
            b"x",
            good[:11],
            b"XX" + good[2:],
            good[:3] + b"\x07" + good[4:],
            good + bytes(400),
            good,
            good,
        ):
            radio._on_datagram(data, here)
        radio._on_datagram(Datagram(DatagramKind.ACK, NodeId(3), NodeId(1), 99).encode(), here)
        radio._on_datagram(Datagram(DatagramKind.ACK, NodeId(3), NodeId(1), 4).encode(), here)  # not the addressee's
        await asyncio.sleep(0.3)
    finally:
        radio.close()
    assert [m.frame for m in told if isinstance(m, Reception)] == [b"x"]
    assert [m.outcome for m in told if isinstance(m, TxStatus)] == [TxOutcome.RETRY_LIMIT]
    assert (radio.counts["malformed"], radio.counts["duplicate"], radio.counts["too_large"]) == (5, 1, 1)


async def test_one_datagram_does_not_redirect_a_node_s_unicasts_and_only_its_own_address_acknowledges() -> None:
    now_ns, told, put = 0, list[Reception | TxStatus](), list[tuple[Datagram, tuple[str, int]]]()
    radio = UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=24562, max_frame_bytes=300,
        now_ns=lambda: now_ns, on_message=told.append,
    )  # fmt: skip
    radio._put = lambda datagram, to: not put.append((datagram, to))  # type: ignore[func-returns-value, method-assign]
    home, elsewhere = ("127.7.0.2", 24562), ("127.7.0.66", 24562)

    def hear(seq: int, address: tuple[str, int]) -> None:
        radio._on_datagram(Datagram(DatagramKind.FRAME, NodeId(2), BROADCAST, seq, b"x").encode(), address)

    async def addresses() -> list[tuple[str, int]]:
        """Where a unicast to node 2 goes that somebody else acknowledges, attempt by attempt."""
        put.clear()
        radio._transmit(request_of(7, at_ms=now_ns // MS, dst=NodeId(2), status=True))
        await asyncio.sleep(0.01)
        radio._on_datagram(Datagram(DatagramKind.ACK, NodeId(2), NodeId(1), put[0][0].seq).encode(), elsewhere)
        await asyncio.sleep(0.2)
        return [to for _, to in put]

    hear(1, home)
    hear(2, elsewhere)
    assert await addresses() == [home, home, home, ("127.255.255.255", 24562)]
    assert [status.outcome for status in told if isinstance(status, TxStatus)] == [TxOutcome.RETRY_LIMIT]
    assert radio.counts["forged"] == 1
    now_ns = MOVED_NS
    hear(3, elsewhere)
    assert await addresses() == [elsewhere], "it was silent at its old address, and has moved"


def silent_radio(now_ns: Callable[[], int]) -> UdpRadio:
    """A radio that is never opened."""
    return UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=24563, max_frame_bytes=300, now_ns=now_ns,
        on_message=lambda _: None,
    )  # fmt: skip


async def test_a_node_that_starts_again_is_heard_from_its_first_frame_on() -> None:
    """Its requests are numbered from 0 again."""
    heard = silent_radio(lambda: 0)
    for _ in range(2):
        sender = UdpRadio(
            NodeId(2), address="127.7.0.2", broadcast="127.255.255.255", port=24563, max_frame_bytes=300,
            now_ns=lambda: 0, on_message=lambda _: None,
        )  # fmt: skip

        def put(datagram: Datagram, to: tuple[str, int]) -> bool:
            heard._on_datagram(datagram.encode(), to)
            return True

        sender._put = put  # type: ignore[method-assign]
        for seq in range(20):
            sender._transmit(request_of(seq, at_ms=0))
            sender._transmit(request_of(seq, at_ms=0))
    assert (heard.counts["received"], heard.counts["duplicate"]) == (40, 40)


async def test_a_request_whose_instant_has_passed_goes_at_once_and_counts_as_late() -> None:
    radio = silent_radio(lambda: 10 * MS)
    radio.request(request_of(1, at_ms=10, dst=BROADCAST))
    assert radio.counts["late"] == 0
    radio.request(request_of(2, at_ms=9, dst=BROADCAST))
    assert radio.counts["late"] == 1


@pytest.mark.parametrize("dst", [BROADCAST, NodeId(2)])
async def test_a_frame_far_behind_its_instant_is_told_and_not_sent(dst: NodeId) -> None:
    """The sender was slow, or this process was stopped between the request and its instant."""
    assert late_requests.TOO_LATE_NS == TOO_LATE_NS
    now_ns, told, put = 0, list[Reception | TxStatus](), list[Datagram]()
    radio = UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=24563, max_frame_bytes=300,
        now_ns=lambda: now_ns, on_message=told.append,
    )  # fmt: skip
    radio._put = lambda datagram, to: not put.append(datagram)  # type: ignore[func-returns-value, method-assign]
    for seq, late_ns in enumerate((0, TOO_LATE_NS, TOO_LATE_NS + 1)):
        radio.request(request_of(seq, at_ms=1, dst=dst, status=True))
        now_ns = MS + late_ns  # the loop comes to it only at this instant
        await asyncio.sleep(0.01)
        now_ns = 0
    assert {datagram.frame[0] for datagram in put} == {0, 1}
    assert [(m.seq, m.outcome) for m in told if isinstance(m, TxStatus) and m.attempts == 0] == [(2, TxOutcome.LATE)]
    assert radio.counts["too_late"] == 1
    radio.close()


async def test_an_interface_that_takes_nothing_fills_no_memory_and_sends_nothing_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Clogged(socket.socket):
        open = False

        def sendto(self, *what: Any) -> int:
            if not Clogged.open:
                raise BlockingIOError
            return super().sendto(*what)

    monkeypatch.setattr(socket, "socket", Clogged)
    told: list[Reception | TxStatus] = []
    radio = UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=free_port(), max_frame_bytes=300,
        now_ns=lambda: 0, on_message=told.append,
    )  # fmt: skip
    await radio.open()
    try:
        for seq in range(50):
            radio._transmit(request_of(seq, at_ms=0, status=True))
        assert [m.outcome for m in told if isinstance(m, TxStatus)] == [TxOutcome.SENT] + 49 * [TxOutcome.QUEUE_FULL]
        assert radio.counts == {"datagrams": 1, "mac_queue_full": 49}
        Clogged.open = True
        await asyncio.sleep(0.01)
        radio._transmit(request_of(50, at_ms=0, status=True))
        assert radio.counts["datagrams"] == 2, "there is room again"
    finally:
        radio.close()


async def test_what_comes_before_the_node_has_a_time_is_counted_and_not_taken_in() -> None:
    now_ns: list[int] = []
    told: list[Reception | TxStatus] = []
    radio = UdpRadio(
        NodeId(1), address="127.7.0.9", broadcast="127.255.255.255", port=24563, max_frame_bytes=300,
        now_ns=lambda: now_ns[-1], on_message=told.append, hears=lambda: bool(now_ns),
    )  # fmt: skip
    for seq in (1, 2):
        heard = Datagram(DatagramKind.FRAME, NodeId(2), BROADCAST, seq, b"x").encode()
        radio._on_datagram(heard, ("127.7.0.2", 1))
        now_ns.append(5)
    assert radio.counts == {"not_running": 1, "received": 1}
    assert told == [Reception(b"x", NodeId(2), 5, 0.0)]


async def test_forged_senders_cannot_fill_the_memory_with_addresses() -> None:
    radio = silent_radio(lambda: 0)
    for node in range(2, MOST_ADDRESSES + 100):
        radio._on_datagram(Datagram(DatagramKind.FRAME, NodeId(node), BROADCAST, 1, b"x").encode(), ("127.7.0.2", 1))
    assert len(radio._addresses) == MOST_ADDRESSES
