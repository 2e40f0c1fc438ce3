"""Commands beside a swarm that runs take the signals of the loop on which they run only while they run."""

import asyncio
import signal
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from fanet_mw.errors import BusError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.gateway import Doors
from sim.run import autopilots, gateway

COMMANDS: dict[str, Callable[[], Coroutine[Any, Any, int]]] = {
    "autopilots": lambda: autopilots.run(
        "tcp/127.0.0.1:9", None, "udpin:127.0.0.1:1+", flavor=Flavor.PX4, zenoh_config=None, tell=print
    ),
    "gateway": lambda: gateway.run("tcp/127.0.0.1:9", None, Doors(), zenoh_config=None, tell=print),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_over_leaves_the_signals_to_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[signal.Handlers | int | Callable[..., Any] | None] = []

    def fail(*_: object, **__: object) -> None:
        heard.append(signal.getsignal(signal.SIGTERM))
        raise BusError("no router")

    async def run() -> list[bool]:
        with pytest.raises(BusError):
            await COMMANDS[name]()
        return [asyncio.get_running_loop().remove_signal_handler(each) for each in (signal.SIGINT, signal.SIGTERM)]

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(autopilots, "BusFeed", fail)
    monkeypatch.setattr(gateway.Bus, "join", fail)
    assert asyncio.run(run()) == [False, False]
    assert heard != [before], "it heeds them while it runs"
