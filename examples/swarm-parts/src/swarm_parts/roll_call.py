"""Every node says its name to all others once in a while, and counts whom it has heard."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, Field

from fanet_mw import Application, AppPort, Data, NodeId, Received, Scenario

PORT = 4242


class Options(BaseModel, extra="forbid"):
    """The table `[applications.options]`."""

    every_s: float = Field(5, ge=0.1, le=1e6)
    """From one call to the next."""


class RollCall(Application):
    """One node's part in it."""

    Options = Options
    name = "roll_call"
    ports = (PORT,)

    def __init__(self, scenario: Scenario, node: NodeId, options: Mapping[str, Any]) -> None:
        self._every_ns = round(Options.model_validate(dict(options)).every_s * 1e9)
        self._greeting = f"node {node}".encode()
        self._next_ns = 0
        self._heard: set[int] = set()

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        self._next_ns = now_ns + int(port.stream("roll_call").random() * self._every_ns)

    def next_wake_ns(self) -> int | None:
        return self._next_ns

    def wake(self, now_ns: int) -> None:
        if now_ns >= self._next_ns:
            self._next_ns += self._every_ns
            self.port.send(Data(PORT, self._greeting))

    def on_message(self, message: Received, now_ns: int) -> None:
        self._heard.add(int(message.origin))

    def report(self) -> Mapping[str, Any]:
        return {"heard": sorted(self._heard)}
