"""Connections to ground stations, as MAVSDK and pymavlink write them: UDP, TCP and serial lines, on asyncio.

    udpout:127.0.0.1:14550   send there, hear what comes back    udpin:0.0.0.0:14550   answer whoever speaks first
    tcpout:127.0.0.1:5760    connect, again and again            tcpin:0.0.0.0:5760    several ground stations
    serial:/dev/ttyUSB0:57600                            open, and again when it was unplugged

Also with `//` after the colon; `udp` and `tcp` are pymavlink's `udpin` and `tcpout`.
"""

import asyncio
import contextlib
import errno
import os
import re
import termios
import tty
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from fanet_mw.errors import BusError, ConfigError

DEFAULT: Final = "udpout:127.0.0.1:14550"
_KINDS: Final = {"udp": "udpin", "tcp": "tcpout"} | {
    kind: kind for kind in ("udpin", "udpout", "tcpin", "tcpout", "serial")
}
_MOST_PEERS: Final = 32
"""Ground stations that a connection answers; the one that was silent longest makes room for another."""
_MOST_WAITING: Final = 1 << 18
"""Bytes that wait for a ground station that reads slowly; more are dropped."""
_AGAIN_S: Final = 1.0
_READ_BYTES: Final = 1 << 16
OnBytes = Callable[[object, bytes], bytes]
"""Takes what a peer has said, and returns what it is to be answered at once."""


class Address(NamedTuple):
    """A connection string, read."""

    kind: str
    host: str
    """Of a serial line the device."""
    port: int
    """Of a serial line the baud rate."""

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def address_of(text: str, *, flag: str = "--mavlink") -> Address:
    """Read a connection string; raises ConfigError."""
    kind, _, rest = text.partition(":")
    host, _, number = rest.removeprefix("//").rpartition(":")
    host = host.strip("[]") or ("0.0.0.0" if kind.endswith("in") or kind == "udp" else "")  # noqa: S104  (its user wrote it)
    if kind not in _KINDS or not host or not re.fullmatch(r"[0-9]{1,7}", number):
        raise ConfigError(f"{flag} {text}: must be udpout:HOST:PORT, udpin:, tcpin:, tcpout: or serial:DEVICE:BAUD")
    if kind == "serial" and not (int(number) and hasattr(termios, f"B{int(number)}")):
        raise ConfigError(f"{flag} {text}: {number} is no baud rate of this machine, for example 57600 or 921600")
    if kind != "serial" and not 0 < int(number) <= 65_535:
        raise ConfigError(f"{flag} {text}: port {number} must be in [1, 65535]")
    return Address(_KINDS[kind], host, int(number))


class Connection:
    """One open connection."""

    def __init__(self, address: Address, on_bytes: OnBytes) -> None:
        self.address = address
        self.dropped = 0
        """Writes that did not reach a ground station because it reads too slowly, or does not listen."""
        self._on_bytes = on_bytes
        self._peers: dict[object, Any] = {}
        """What takes bytes for each ground station, the one that spoke last at the end."""
        self._close: list[Callable[[], None]] = []
        """The functions that close the servers, tasks and streams that are open."""

    async def open(self) -> None:
        """Raises BusError."""
        loop, (kind, host, port) = asyncio.get_running_loop(), self.address
        try:
            if kind == "udpin":
                await loop.create_datagram_endpoint(lambda: _Datagrams(self), local_addr=(host, port))
            elif kind == "udpout":
                await loop.create_datagram_endpoint(lambda: _Datagrams(self, fixed=True), remote_addr=(host, port))
            elif kind == "tcpin":
                server = await loop.create_server(lambda: _Stream(self), host, port)
                self._close.append(server.close)
            elif kind == "tcpout":
                task = loop.create_task(self._connect(host, port))
                self._close.append(partial(_cancel, task))
            else:
                line = _SerialLine(self, host, port)
                line.open()
                self._close.append(line.close)
        except OSError as error:
            raise BusError(f"{self.address}: {error.strerror or error}") from error

    def send(self, data: bytes) -> None:
        """To all ground stations of this connection."""
        for peer, write in [*self._peers.items()]:
            self._write(peer, write, data)

    def close(self) -> None:
        for close in self._close:
            close()
        self._peers.clear()

    # --- for the protocols below ----------------------------------------------------------------------------------

    def came(self, peer: object, write: Callable[[bytes], bool]) -> None:
        self._peers.pop(peer, None)
        while len(self._peers) >= _MOST_PEERS:
            silent = next(iter(self._peers))
            del self._peers[silent]
            if isinstance(silent, _Stream):
                silent.abort()
        self._peers[peer] = write

    def went(self, peer: object) -> None:
        self._peers.pop(peer, None)

    def closes(self, close: Callable[[], None]) -> None:
        self._close.append(close)

    def closed(self, close: Callable[[], None]) -> None:
        self._close.remove(close)

    def said(self, peer: object, data: bytes) -> None:
        answer = self._on_bytes(peer, data)
        write = self._peers.pop(peer, None)
        if write is None:
            return
        self._peers[peer] = write
        if answer:
            self._write(peer, write, answer)

    def _write(self, peer: object, write: Callable[[bytes], bool], data: bytes) -> None:
        try:
            self.dropped += not write(data)
        except OSError:
            self.dropped += 1
            if self.address.kind.startswith("tcp"):
                self.went(peer)

    async def _connect(self, host: str, port: int) -> None:
        """Connect, and again when the connection has ended."""
        loop = asyncio.get_running_loop()
        while True:
            with contextlib.suppress(OSError):
                _, stream = await loop.create_connection(lambda: _Stream(self), host, port)
                await stream.ended.wait()
            await asyncio.sleep(_AGAIN_S)


def _cancel(task: asyncio.Task[None]) -> None:
    task.cancel()


class _Datagrams(asyncio.DatagramProtocol):
    """A UDP socket; a fixed one sends to one address, another to whoever has spoken."""

    def __init__(self, connection: Connection, *, fixed: bool = False) -> None:
        self._connection, self._fixed = connection, fixed

    def connection_made(self, transport: Any) -> None:  # noqa: ANN401  (asyncio's types are of no use here)
        self._transport = transport
        self._connection.closes(transport.close)
        if self._fixed:
            self._connection.came(None, self._writer(None))

    def _writer(self, to: Any) -> Callable[[bytes], bool]:  # noqa: ANN401
        def write(data: bytes) -> bool:
            if self._transport.get_write_buffer_size() > _MOST_WAITING:
                return False
            self._transport.sendto(data, to)
            return True

        return write

    def datagram_received(self, data: bytes, peer: Any) -> None:  # noqa: ANN401
        where = None if self._fixed else peer
        if not self._fixed:
            self._connection.came(peer, self._writer(peer))
        self._connection.said(where, data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens there yet; heartbeats go on."""
        self._connection.dropped += 1


class _Stream(asyncio.Protocol):
    """A TCP connection."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self.ended = asyncio.Event()

    def connection_made(self, transport: Any) -> None:  # noqa: ANN401
        self._transport = transport
        self._connection.closes(self.abort)

        def write(data: bytes) -> bool:
            if transport.is_closing() or transport.get_write_buffer_size() > _MOST_WAITING:
                return False
            transport.write(data)
            return True

        self._connection.came(self, write)

    def abort(self) -> None:
        self._transport.abort()

    def data_received(self, data: bytes) -> None:
        self._connection.said(self, data)

    def connection_lost(self, _error: Exception | None) -> None:
        self._connection.went(self)
        self._connection.closed(self.abort)
        self.ended.set()


class _SerialLine:
    """A serial line; one that was unplugged is opened again, and again."""

    def __init__(self, connection: Connection, device: str, baud: int) -> None:
        self._connection, self._device, self._baud = connection, device, baud
        self._loop = asyncio.get_running_loop()
        self._line: int | None = None
        self._rest = b""
        """What the line had no room for of the last write; meanwhile others are dropped, so that none is cut."""
        self._again: asyncio.TimerHandle | None = None

    def open(self) -> None:
        """Raises OSError; ENOTTY for what is no serial line."""
        line = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(line)
            settings = termios.tcgetattr(line)
            settings[4] = settings[5] = getattr(termios, f"B{self._baud}")
            termios.tcsetattr(line, termios.TCSANOW, settings)
        except termios.error as error:
            os.close(line)
            raise OSError(errno.ENOTTY, "it is no serial line") from error
        self._line, self._rest = line, b""
        self._loop.add_reader(line, self._read)
        self._connection.came(self._device, self._write)

    def close(self) -> None:
        if self._again is not None:
            self._again.cancel()
        if self._line is not None:
            self._loop.remove_reader(self._line)
            self._loop.remove_writer(self._line)
            os.close(self._line)
            self._line = None

    def _read(self) -> None:
        assert self._line is not None, "only an open line is read"
        try:
            data = os.read(self._line, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._connection.said(self._device, data)
        else:  # it was unplugged
            self.close()
            self._connection.went(self._device)
            self._try_again()

    def _try_again(self) -> None:
        self._again = self._loop.call_later(_AGAIN_S, self._open_again)

    def _open_again(self) -> None:
        try:
            self.open()
        except OSError:
            self._try_again()

    def _write(self, data: bytes) -> bool:
        if self._line is None or self._rest:
            return False
        try:
            self._rest = data[os.write(self._line, data) :]
        except BlockingIOError:
            return False
        if self._rest:
            self._loop.add_writer(self._line, self._write_rest)
        return True

    def _write_rest(self) -> None:
        assert self._line is not None, "only an open line is written to"
        try:
            self._rest = self._rest[os.write(self._line, self._rest) :]
        except BlockingIOError:
            return
        except OSError:
            self._rest = b""  # it was unplugged
        if not self._rest:
            self._loop.remove_writer(self._line)
