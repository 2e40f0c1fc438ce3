"""The connections to ground stations, over sockets of this machine."""

import asyncio
import contextlib
import gc
import os
import pty
import socket
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.gateway.connections import Connection, address_of


def test_a_connection_keeps_nothing_of_ground_stations_that_have_gone() -> None:
    def kept() -> int:
        gc.collect()
        return sum(issubclass(type(each), asyncio.Transport) for each in gc.get_objects())  # it may be a dead proxy

    async def run() -> int:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        heard: list[bytes] = []
        before = kept()

        def on_bytes(_: object, data: bytes) -> bytes:
            heard.append(data)
            return b"hello"

        connection = Connection(address_of(f"tcpin:127.0.0.1:{port}"), on_bytes)
        await connection.open()
        for _ in range(5):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"here")
            assert await reader.readexactly(5) == b"hello"
            writer.close()
            await writer.wait_closed()
        del reader, writer
        await asyncio.sleep(0.05)
        stays, writer = await asyncio.open_connection("127.0.0.1", port)
        now = kept() - before
        connection.close()
        assert await stays.read() == b"", "one that is there is closed with the connection"
        writer.close()
        assert heard == [b"here"] * 5
        return now

    assert asyncio.run(run()) == 2, "both ends of one"


def test_the_ground_station_that_was_silent_longest_makes_room_and_is_told_so() -> None:
    async def run() -> list[bytes]:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        connection = Connection(address_of(f"tcpin:127.0.0.1:{port}"), lambda _, data: data)
        await connection.open()
        open_ = [await asyncio.open_connection("127.0.0.1", port) for _ in range(32)]
        for reader, writer in open_[:1]:
            writer.write(b"here")
            assert await reader.readexactly(4) == b"here"
        open_.append(await asyncio.open_connection("127.0.0.1", port))
        await asyncio.sleep(0.05)
        connection.send(b"all")
        heard = [await asyncio.wait_for(reader.read(3), 2) for reader, _ in open_]
        for _, writer in open_:
            writer.close()
        connection.close()
        return heard

    assert asyncio.run(run()) == [b"all", b"", *[b"all"] * 31]


def test_a_full_serial_line_loses_whole_writes_and_no_part_of_one() -> None:
    line = bytes(range(97, 122)) * 40 + b"\n"

    async def run() -> tuple[bytes, int]:
        ours, theirs = pty.openpty()
        connection = Connection(address_of(f"serial:{os.ttyname(theirs)}:57600"), lambda _, __: b"")
        await connection.open()
        for _ in range(200):
            connection.send(line)
        os.set_blocking(ours, False)
        heard = b""
        for _ in range(100):
            await asyncio.sleep(0.005)
            with contextlib.suppress(BlockingIOError):
                heard += os.read(ours, 1 << 16)
        connection.close()
        os.close(ours)
        os.close(theirs)
        return heard, connection.dropped

    heard, dropped = asyncio.run(run())
    assert 0 < dropped < 200
    assert heard == (200 - dropped) * line


def test_a_serial_line_that_was_unplugged_is_opened_again_once_it_is_back(tmp_path: Path) -> None:
    async def run() -> bytes:
        device, heard = tmp_path / "ttyACM0", b""

        def on_bytes(_: object, data: bytes) -> bytes:
            nonlocal heard
            heard += data
            return b"answer"

        ours, theirs = pty.openpty()
        device.symlink_to(os.ttyname(theirs))
        connection = Connection(address_of(f"serial:{device}:57600"), on_bytes)
        await connection.open()
        os.close(theirs)
        os.write(ours, b"before ")
        await asyncio.sleep(0.05)
        device.unlink()
        os.close(ours)
        await asyncio.sleep(1.3)
        connection.send(b"to nobody")
        ours, theirs = pty.openpty()
        device.symlink_to(os.ttyname(theirs))
        await asyncio.sleep(1.2)
        os.write(ours, b"after")
        await asyncio.sleep(0.05)
        answer = os.read(ours, 64)
        connection.close()
        os.close(ours)
        os.close(theirs)
        assert answer == b"answer"
        return heard

    assert asyncio.run(run()) == b"before after"


def test_a_baud_rate_of_zero_is_none() -> None:
    with pytest.raises(ConfigError, match="0 is no baud rate"):
        address_of("serial:/dev/ttyUSB0:0")
