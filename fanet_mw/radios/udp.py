"""A radio on a real network interface: frames are UDP datagrams; broadcasts, and unicasts with acknowledgement.

    request -> waits for its instant -> socket -> driver and air -> socket of the other node -> reception

An ad hoc (IBSS or mesh) Wi-Fi interface whose driver does CSMA/CA. Unicasts are acknowledged by the other radio, and
sent up to `ATTEMPTS` times: drivers do not tell of the MAC's own ACK. A frame far behind its instant, or without room
in the socket, is dropped: it would go out in the turn of another node. The RSSI is not known (0), and `end_ns` is the
instant of reading.
"""

import asyncio
import secrets
import socket
import struct
from collections import Counter
from collections.abc import Callable
from enum import IntEnum
from typing import Any, Final, NamedTuple, Self

from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.errors import BusError, DropReason, MalformedFrameError
from fanet_mw.node.duplicates import DuplicateSet, key_of
from fanet_mw.units import BROADCAST, MAX_NODES, MS, NodeId, S

PORT: Final = 14560
MAX_PORT: Final = 0xFFFF
ATTEMPTS: Final = 4
_ACK_WAIT_S: Final = 0.03
TOO_LATE_NS: Final = 50 * MS
"""A frame that is later than this is dropped, because its slot belongs to another node by then."""
_RSSI_UNKNOWN_DBM: Final = 0.0
_RECEIVED: Final = 1
MOVED_NS: Final = 10 * S
"""A node may change its address when it has been silent at the former one for this long."""
MOST_ADDRESSES: Final = 4096
Address = tuple[str, int]


_LAYOUT: Final = struct.Struct("!2sBBHHI")
_MAGIC: Final = b"FN"
_VERSION: Final = 1
SEQ_MASK: Final = 0xFFFF_FFFF


class DatagramKind(IntEnum):
    """The kind of a datagram."""

    FRAME = 0
    ACK = 1


class Datagram(NamedTuple):
    """The payload of a UDP packet: "FN" | version | kind | source | destination | sequence number | frame."""

    kind: DatagramKind
    src: NodeId
    dst: NodeId
    seq: int
    frame: bytes = b""

    def encode(self) -> bytes:
        return _LAYOUT.pack(_MAGIC, _VERSION, self.kind, self.src, self.dst, self.seq & SEQ_MASK) + self.frame

    @classmethod
    def decode(cls, data: bytes) -> Self:
        """Decode a UDP payload; raises MalformedFrameError."""
        if len(data) < _LAYOUT.size:
            raise MalformedFrameError(f"datagram of {len(data)} bytes")
        magic, version, kind, src, dst, seq = _LAYOUT.unpack_from(data)
        if magic != _MAGIC or version != _VERSION or kind > DatagramKind.ACK:
            raise MalformedFrameError(f"datagram of version {version}, kind {kind}")
        if not 1 <= src <= MAX_NODES or not (1 <= dst <= MAX_NODES or dst == BROADCAST):
            raise MalformedFrameError(f"datagram from {src} to {dst}")
        frame = data[_LAYOUT.size :]
        if bool(frame) == (kind == DatagramKind.ACK):
            raise MalformedFrameError(f"datagram of kind {kind} with {len(frame)} bytes")
        return cls(DatagramKind(kind), NodeId(src), NodeId(dst), seq, frame)


class _KnownAddress(NamedTuple):
    """The address at which a node was heard, and when it was last heard there."""

    address: Address
    heard_ns: int


class UdpRadio:
    """The radio of one node. It passes receptions and statuses to `on_message`, on the thread of the event loop."""

    def __init__(
        self,
        node: NodeId,
        *,
        address: str,
        broadcast: str,
        max_frame_bytes: int,
        now_ns: Callable[[], int],
        on_message: Callable[[Reception | TxStatus], None],
        port: int = PORT,
        hears: Callable[[], bool] = lambda: True,
    ) -> None:
        """`hears` tells whether datagrams are accepted; they are not while the node has no swarm time."""
        self._node = node
        self._address = (address, port)
        self._broadcast = (broadcast, port)
        self._max_frame_bytes = max_frame_bytes
        self._now_ns = now_ns
        self._on_message = on_message
        self._hears = hears
        self._loop = asyncio.get_running_loop()
        self._addresses: dict[NodeId, _KnownAddress] = {}
        self._waiting: dict[tuple[NodeId, int], asyncio.Event] = {}
        """The unicasts that wait for their acknowledgement, by destination and sequence number."""
        self._tasks: set[asyncio.Task[None]] = set()
        self._seen = DuplicateSet(capacity=8192)
        self._first_seq = secrets.randbits(32)
        """The number of request 0's datagram: random, as those after a restart are no copies of earlier ones."""
        self._transports: list[asyncio.DatagramTransport] = []
        """The socket of the own address, by which everything is sent, and that of the broadcast address."""
        self.counts: Counter[str] = Counter()

    async def open(self) -> None:
        """Bind to the own address, for unicasts, and to the broadcast address; raises BusError."""
        try:
            for address in (self._address, self._broadcast):
                self._transports.append(await self._bind(address))
        except OSError as error:
            self.close()
            raise BusError(f"cannot use {self._address[0]} and {self._broadcast[0]}: {error.strerror}") from error

    async def _bind(self, address: Address) -> asyncio.DatagramTransport:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # for several radios
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            sock.settimeout(0)
            sock.bind(address)
            transport, _ = await self._loop.create_datagram_endpoint(lambda: _Endpoint(self._on_datagram), sock=sock)
        except BaseException:
            sock.close()
            raise
        return transport

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        for transport in self._transports:
            transport.close()
        self._transports.clear()

    # --- transmit -------------------------------------------------------------------------------------------------

    def request(self, request: TxRequest) -> None:
        """Send a frame at its instant, or at once and late; later than TOO_LATE_NS it is dropped."""
        self.counts["sent"] += 1
        if not 0 < len(request.frame) <= self._max_frame_bytes:
            self._refuse(DropReason.TOO_LARGE if request.frame else DropReason.MALFORMED, request)
            return
        wait_ns = request.start_ns - self._now_ns()
        if wait_ns < 0:
            self.counts["late"] += 1
        self._loop.call_later(max(0, wait_ns) / S, self._transmit, request)

    def _refuse(self, reason: DropReason, request: TxRequest) -> None:
        self.counts[reason] += 1
        self._not_sent(request, TxOutcome.REFUSED)

    def _not_sent(self, request: TxRequest, outcome: TxOutcome) -> None:
        if request.wants_status:
            self._on_message(TxStatus(request.seq, outcome, self._now_ns(), 0))

    def _transmit(self, request: TxRequest) -> None:
        now_ns = self._now_ns()
        if now_ns - request.start_ns > TOO_LATE_NS or 0 < request.until_ns <= now_ns:
            self.counts["too_late"] += 1
            self._not_sent(request, TxOutcome.LATE)
            return
        if request.dst == BROADCAST:
            if not self._put(self._datagram(request), self._broadcast):
                self._not_sent(request, TxOutcome.QUEUE_FULL)
            elif request.wants_status:
                self._on_message(TxStatus(request.seq, TxOutcome.SENT, self._now_ns(), 1))
            return
        task = self._loop.create_task(self._unicast(request))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _unicast(self, request: TxRequest) -> None:
        """Send a frame until it is acknowledged; to the broadcast address if the other node was never heard."""
        datagram = self._datagram(request)
        name = request.dst, datagram.seq
        acknowledged = self._waiting[name] = asyncio.Event()
        outcome, attempts = TxOutcome.RETRY_LIMIT, 0
        try:
            while attempts < ATTEMPTS:
                attempts += 1
                known = self._addresses.get(request.dst)
                self._put(datagram, known.address if known and attempts < ATTEMPTS else self._broadcast)
                try:
                    await asyncio.wait_for(acknowledged.wait(), _ACK_WAIT_S)
                except TimeoutError:
                    continue
                outcome = TxOutcome.ACKED
                break
        finally:
            del self._waiting[name]
        if outcome is TxOutcome.RETRY_LIMIT:
            self.counts[DropReason.RETRY_LIMIT] += 1
        if request.wants_status:
            self._on_message(TxStatus(request.seq, outcome, self._now_ns(), attempts))

    def _datagram(self, request: TxRequest) -> Datagram:
        seq = (self._first_seq + request.seq) & SEQ_MASK
        return Datagram(DatagramKind.FRAME, self._node, request.dst, seq, request.frame)

    def _put(self, datagram: Datagram, to: Address) -> bool:
        """Send a datagram; False if dropped, as an earlier one still waits: asyncio would keep any number."""
        if not self._transports:
            return False
        if self._transports[0].get_write_buffer_size():  # type: ignore[attr-defined]  # typeshed lacks it
            self.counts[DropReason.MAC_QUEUE_FULL] += 1
            return False
        self._transports[0].sendto(datagram.encode(), to)
        self.counts["datagrams"] += 1
        return True

    # --- receive --------------------------------------------------------------------------------------------------

    def _on_datagram(self, data: bytes, address: Address) -> None:
        """Handle one datagram, which any process may have sent."""
        if not self._hears():
            self.counts["not_running"] += 1
            return
        try:
            datagram = Datagram.decode(data)
        except MalformedFrameError:
            self.counts[DropReason.MALFORMED] += 1
            return
        if datagram.src == self._node:
            return  # this is the node's own broadcast
        at_home = self._take_address(datagram.src, address)
        if datagram.dst not in (BROADCAST, self._node):
            return
        if datagram.kind is DatagramKind.ACK:
            waiting = self._waiting.get((datagram.src, datagram.seq))
            if not at_home:
                self.counts[DropReason.FORGED] += 1
            elif waiting is not None:
                waiting.set()
            return
        self._on_frame(datagram, address)

    def _take_address(self, node: NodeId, address: Address) -> bool:
        """Accept a node's address; False if it was heard lately at another, so that no single datagram redirects its
        traffic. Frames are accepted from any address: nobody can lock a node out by sending first under its id.
        """
        now_ns, known = self._now_ns(), self._addresses.get(node)
        if known is not None and known.address != address and now_ns - known.heard_ns < MOVED_NS:
            return False
        if known is None and len(self._addresses) >= MOST_ADDRESSES:
            del self._addresses[min(self._addresses, key=lambda other: (self._addresses[other].heard_ns, other))]
        self._addresses[node] = _KnownAddress(address, now_ns)
        return True

    def _on_frame(self, datagram: Datagram, address: Address) -> None:
        if datagram.dst == self._node:
            self._put(Datagram(DatagramKind.ACK, self._node, datagram.src, datagram.seq), address)
        key = key_of(origin=datagram.src, seq=datagram.seq)
        if len(datagram.frame) > self._max_frame_bytes:
            self.counts[DropReason.TOO_LARGE] += 1
        elif self._seen.bits(key):
            self.counts[DropReason.DUPLICATE] += 1
        else:
            self._seen.mark(key, _RECEIVED)
            self.counts["received"] += 1
            self._on_message(Reception(datagram.frame, datagram.src, self._now_ns(), _RSSI_UNKNOWN_DBM))


class _Endpoint(asyncio.DatagramProtocol):
    """Passes received datagrams on; errors of sent ones, such as a missing receiver, are ignored."""

    def __init__(self, take: Callable[[bytes, Address], None]) -> None:
        self._on_datagram = take

    def datagram_received(self, data: bytes, addr: tuple[str | Any, int]) -> None:
        self._on_datagram(data, (str(addr[0]), addr[1]))
