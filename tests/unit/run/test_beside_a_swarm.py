"""Commands beside a swarm that runs take the signals of the loop on which they run only while they run."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Coroutine
from typing import Any, Self

import pytest

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.gateway import Doors
from sim.run import autopilots, gateway
from sim.scenarios import catalog

COMMANDS: dict[str, Callable[[], Coroutine[Any, Any, int]]] = {
    "autopilots": lambda: autopilots.run(
        "tcp/127.0.0.1:9", None, "udpin:127.0.0.1:1+", flavor=Flavor.PX4, zenoh_config=None, tell=print
    ),
    "gateway": lambda: gateway.run("tcp/127.0.0.1:9", None, Doors(), zenoh_config=None, tell=print),
}


class Joined:
    """A router, and a swarm that is over as soon as it is listened to."""

    bus = names = scenario = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


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
    monkeypatch.setattr(autopilots, "BusFeed", lambda *_, **__: Joined())
    monkeypatch.setattr(autopilots, "ClockListener", fail)
    monkeypatch.setattr(gateway.Bus, "join", lambda *_, **__: Joined())
    monkeypatch.setattr(gateway, "find_swarm", lambda _: "small")
    monkeypatch.setattr(gateway, "serve", fail)
    assert asyncio.run(run()) == [False, False]
    assert heard != [before], "it heeds them while it runs"


class Unstarted:
    """The router of a swarm whose clock does not start, because somebody else is missing."""

    def __init__(self) -> None:
        self.announced: list[str] = []

    def announce(self, topic: str) -> None:
        self.announced.append(topic)
        os.kill(os.getpid(), signal.SIGINT)

    def nothing(self, *_: object, **__: object) -> None:
        pass

    subscribe = ask = put = check = nothing


def test_a_world_of_flight_controllers_that_waits_for_the_clock_ends_when_interrupted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    router, feed = Unstarted(), Joined()
    feed.bus, feed.names = router, Topics("small")  # type: ignore[assignment]
    feed.scenario = catalog.find("quick", ["mobility.model=onboard"])  # type: ignore[assignment]

    async def heard(*_: object) -> bool:
        return True

    async def run() -> int:
        return await asyncio.wait_for(
            autopilots.run(
                "tcp/127.0.0.1:9", None, "udpin:127.0.0.1:24541+", flavor=Flavor.PX4, zenoh_config=None, tell=print
            ),
            10,
        )

    monkeypatch.setattr(autopilots, "BusFeed", lambda *_, **__: feed)
    monkeypatch.setattr(autopilots, "_all_heard", heard)
    assert asyncio.run(run()) == 0
    assert router.announced, "it was interrupted only after it had come up"


@pytest.mark.parametrize(
    "words",
    [
        ["gateway"],
        ["autopilots", "udpin:127.0.0.1:14999+"],
        ["world", "quick"],
        ["emulator", "quick"],
        ["agent", "quick", "--id", "1"],
        ["agent", "quick", "--id", "1", "--autopilot", "udpin:127.0.0.1:14999"],
        ["agent", "quick", "--id", "1", "--radio-address", "127.0.0.1", "--radio-broadcast", "127.255.255.255"],
    ],
    ids=lambda words: " ".join((words[0], *words[4:5])),
)
def test_a_command_that_waits_for_a_router_which_does_not_answer_ends_at_once_when_interrupted(
    words: list[str],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as router:
        endpoint = f"tcp/127.0.0.1:{router.getsockname()[1]}"
        command = [sys.executable, "-m", "fanet_mw", *words, "--connect", endpoint, "--swarm", "small"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            router.settimeout(60)
            router.accept()[0].close()
            process.send_signal(signal.SIGINT)
            assert process.communicate(timeout=8) == (None, "")
            assert process.returncode == 128 + signal.SIGINT
