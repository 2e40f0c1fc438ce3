"""The connections to ground stations, over sockets of this machine."""

import asyncio
import gc
import socket

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
