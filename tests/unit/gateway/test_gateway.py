"""The process around the links: what it says of what did not pass."""

import asyncio
from collections.abc import Callable
from typing import Any

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.bus.topics import Topics
from fanet_mw.gateway.gateway import Doors, Gateway, SwarmFacts
from fanet_mw.mavlink import Encoder
from fanet_mw.units import NodeId, S

NAMES = Topics("g")


class QuietBus:
    """A bus on which nobody answers; it keeps who listens to what."""

    def __init__(self) -> None:
        self.listeners: dict[str, Callable[[str, bytes], None]] = {}

    def subscribe(self, expression: str, on_sample: Callable[[str, bytes], None]) -> None:
        self.listeners[expression] = on_sample

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None: ...

    def ask(self, topic: str, on_sample: Callable[[str, bytes], None]) -> None: ...

    def check(self) -> None: ...


def test_what_the_gateway_itself_could_not_take_is_told(monkeypatch: Any) -> None:
    monkeypatch.setattr("fanet_mw.gateway.gateway._MOST_WAITING", 3)
    told: list[str] = []

    async def run() -> None:
        bus, over = QuietBus(), asyncio.Event()
        gateway = Gateway(bus, NAMES, SwarmFacts([NodeId(1)], S, None), Doors(), tell=told.append)  # type: ignore[arg-type]
        serving = asyncio.ensure_future(gateway.serve(over))
        await asyncio.sleep(0.01)
        on_tap = bus.listeners[NAMES.mavlink("*")]
        tap = codecs.encode([MavlinkTap(0, Encoder(NodeId(1), component=1).heartbeat())])
        for payload in (b"\xff no tap", tap, tap, tap, tap):
            on_tap(NAMES.mavlink(1), payload)
        await asyncio.sleep(0.01)
        over.set()
        await serving

    asyncio.run(run())
    assert told[1:] == ["did not pass: 2 lost here, 1 malformed taps"]
