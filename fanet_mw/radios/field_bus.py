"""The bus of a UAV in the field: its node's radio topics go to a real radio, all others to Zenoh if there is a router.

Without a router there is neither a world nor a launcher: swarm time starts at an instant that all nodes were told, and
traces, telemetry and reports stay with the node.
"""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Protocol

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockState, Message, Reception, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus, OnSample
from fanet_mw.units import NodeId


class RadioPort(Protocol):
    """The radio, as a node needs it."""

    def request(self, request: TxRequest) -> None: ...


class FieldBus:
    """A bus for a host, like `Bus`, except that the radio topics of its node go to a real radio."""

    def __init__(self, names: Topics, node: NodeId, *, inner: Bus | None, epoch_unix_ns: int | None) -> None:
        self._tx_topic = names.radio_tx(node)
        self._rx_topic = names.radio_rx(node)
        self._clock_topic = names.clock
        self._report_topic = names.report(f"agent-{node}")
        self._inner = inner
        self._clock = None if epoch_unix_ns is None else ClockEpoch(epoch_unix_ns, 1.0, ClockState.RUNNING)
        self._on_rx: OnSample | None = None
        self._radio: RadioPort | None = None
        self.reports: list[bytes] = []
        """The last report, which is kept while there is no router to receive it."""

    def use(self, radio: RadioPort) -> None:
        self._radio = radio

    def on_radio(self, message: Reception | TxStatus) -> None:
        if self._on_rx is not None:
            self._on_rx(self._rx_topic, codecs.encode([message]))

    # --- the interface of `Bus` -----------------------------------------------------------------------------------

    def subscribe(self, expression: str, on_sample: OnSample) -> None:
        if expression == self._rx_topic:
            self._on_rx = on_sample
        elif self._inner is not None:
            self._inner.subscribe(expression, on_sample)

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None:
        if topic == self._tx_topic:
            for message in _decoded(payload):
                if isinstance(message, TxRequest) and self._radio is not None:
                    self._radio.request(message)
        elif self._inner is not None:
            self._inner.put(topic, payload, reliable=reliable)
        elif topic == self._report_topic:
            self.reports[:] = [payload]

    def announce(self, topic: str) -> None:
        if self._inner is not None:
            self._inner.announce(topic)

    def ask(self, topic: str, on_sample: OnSample) -> None:
        if topic == self._clock_topic and self._clock is not None:
            on_sample(topic, codecs.encode([self._clock]))
        elif self._inner is not None:
            self._inner.ask(topic, on_sample)

    def check(self) -> None:
        if self._inner is not None:
            self._inner.check()


def _decoded(payload: bytes) -> list[Message]:
    """The messages from the own node; bytes that cannot be decoded are a bug of this program, and raise."""
    return list(codecs.decode(payload))


@contextlib.asynccontextmanager
async def joined(endpoint: str | None, config: Path | None = None) -> AsyncIterator[Bus | None]:
    """A session with the router if an endpoint is given; `config` is a configuration file of Zenoh."""
    if endpoint is None:
        yield None
        return
    with await Bus.join_on_loop(endpoint, config) as bus:
        yield bus
