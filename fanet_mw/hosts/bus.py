"""One Zenoh session, with the settings a swarm needs, as a context manager that always closes it.

Scouting is off: who connects to whom is said, never discovered. Frames, poses and sensor readings are best effort and
dropped under congestion (late is worse than lost, and gaps are counted); traces and reports are reliable.
"""

import contextlib
import json
import time
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Protocol, Self

import zenoh

from fanet_mw.errors import BusError, ConfigError

JOIN_PATIENCE_S: Final = 2.5
"""How long a router is waited for by default: a person who mistyped an endpoint is told soon."""
MAX_PUT_BYTES: Final = 16 << 20
"""A longer put is given up where it first arrives: by default Zenoh would gather up to 1 GiB of one in memory."""
LOST_AFTER_S: Final = 2.0
"""A router that has been away for this long is taken to be gone. Zenoh reconnects by itself to one that comes back."""
OnSample = Callable[[str, bytes], None]
"""(topic, payload); called on a thread of Zenoh's."""


class HostBus(Protocol):
    """What a host needs of a bus: `Bus`, or one that keeps some topics to itself."""

    def subscribe(self, expression: str, on_sample: OnSample) -> None: ...

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None: ...

    def announce(self, topic: str) -> None: ...

    def ask(self, topic: str, on_sample: OnSample) -> None: ...

    def check(self) -> None: ...


def config_of(path: Path | None, name: str) -> Path | None:
    """The configuration file of a participant: the file that was given, or NAME.json5 in the folder that was given."""
    return path / f"{name}.json5" if path is not None and path.is_dir() else path


def exposure(endpoint: str, *, listens: bool) -> str | None:
    """A warning for an endpoint that others can reach or forge; None for the loopback interface and for TLS or QUIC."""
    protocol, _, address = endpoint.partition("/")
    host = address.partition("#")[0].partition("?")[0].rpartition(":")[0].strip("[]")
    if protocol in ("tls", "quic", "unixsock-stream", "unixpipe") or host == "localhost":
        return None
    with contextlib.suppress(ValueError):
        if ip_address(host).is_loopback:
            return None
    who = "whoever reaches it" if listens else "whoever is on the way"
    return (
        f"{endpoint} is neither on the loopback interface nor encrypted: {who} can stop the clock, move UAVs, change "
        f"the air and forge results. See docs/how-to/security.md for tls/ with access lists (fanet keys, "
        f"--zenoh-config)"
    )


def _config(
    *, mode: str, listen: str | None, connect: str | None, file: Path | None, patience_s: float = 0.0
) -> zenoh.Config:
    """Our settings over those of a configuration file of Zenoh; raises ConfigError when that cannot be used."""
    try:
        config = zenoh.Config() if file is None else zenoh.Config.from_file(str(file))
    except zenoh.ZError as error:
        raise ConfigError(f"--zenoh-config {file}: {_first_sentence(error)}") from error
    settings: dict[str, object] = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": [listen] if listen else [],
        "listen/exit_on_failure": True,
        # Some seconds after its opening each session would map and zero 16 MB of shared memory, all at the same time:
        # 45 of them stall two cores for half a second in the middle of a run. Frames are far too small to gain by it.
        "transport/shared_memory/enabled": False,
        # One wake-up of the medium is one put per UAV, all at once: room for such a burst, and time to write it out.
        "transport/link/rx/max_message_size": MAX_PUT_BYTES,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 5000,
        "connect/endpoints": [connect] if connect else [],
        "connect/exit_on_failure": True,
        "connect/timeout_ms": round(1000 * patience_s),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


class Bus:
    """A session of one process: a client of a router, or the router itself."""

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self._session = session
        self._endpoint = endpoint
        self._publishers: dict[str, Any] = {}
        self._tokens: list[Any] = []
        self._away_since_s: float | None = None

    @classmethod
    def serve(cls, endpoint: str, config: Path | None = None) -> Self:
        """Be the router, with a configuration file of Zenoh's for what is not said here (TLS, access lists).

        Raises BusError when the endpoint cannot be listened on, ConfigError when the file cannot be used.
        """
        settings = _config(mode="router", listen=endpoint, connect=None, file=config)
        try:
            return cls(zenoh.open(settings), endpoint)
        except zenoh.ZError as error:
            why = "it is already in use" if "in use" in str(error) else _first_sentence(error)
            raise BusError(f"cannot serve on {endpoint}: {why}") from error

    @classmethod
    def join(cls, endpoint: str, config: Path | None = None, *, patience_s: float = JOIN_PATIENCE_S) -> Self:
        """Connect to a router, with a configuration file of Zenoh's; raises BusError when none answers in time.

        A process of a swarm, whose router is known to be there, has more patience: on a busy machine a handshake may
        take seconds. Raises ConfigError when the file cannot be used.
        """
        settings = _config(mode="client", listen=None, connect=endpoint, file=config, patience_s=patience_s)
        try:
            return cls(zenoh.open(settings), endpoint)
        except zenoh.ZError as error:
            why = "no answer" if "onnect" in str(error) else _first_sentence(error)
            raise BusError(
                f"no Zenoh router at {endpoint} ({why} within {patience_s:g} s); "
                f"start one with `fanet router` or `fanet launch --listen {endpoint}`"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the session; a process that does not would hang at its exit."""
        self._publishers.clear()
        if self._session.is_closed():
            return
        with contextlib.suppress(zenoh.ZError):  # a router that is frozen cannot be said goodbye to
            self._session.close()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it

    def subscribe(self, expression: str, on_sample: OnSample) -> None:
        """Hear a key expression for the life of the session; raises BusError when no thread can be had for it."""
        try:
            self._session.declare_subscriber(
                expression, lambda sample: on_sample(str(sample.key_expr), sample.payload.to_bytes())
            )
        except RuntimeError as error:
            raise BusError(f"cannot listen to {expression}: {error} (see ulimit -u and ulimit -v)") from error

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None:
        """Publish; without a router it is dropped (see `check`). Raises BusError on a session that was closed."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            control = zenoh.CongestionControl.BLOCK if reliable else zenoh.CongestionControl.DROP
            if self._session.is_closed():
                raise BusError(f"cannot put on {topic}: the session with {self._endpoint} is closed")
            # Not express: under pressure Zenoh then packs many puts into one of its few send buffers. Express, a burst
            # of small ones fills these at once, and the rest is dropped (0.4 % of the frames of 45 agents on 2 cores).
            publisher = self._publishers[topic] = self._session.declare_publisher(
                topic, congestion_control=control, express=False
            )
        publisher.put(payload)

    def announce(self, topic: str) -> None:
        """A liveliness token: others see it until this session ends, however it ends."""
        self._tokens.append(self._session.liveliness().declare_token(topic))

    def watch(self, expression: str, on_change: Callable[[str, bool], None]) -> None:
        """Hear of liveliness tokens, those already there included: (topic, alive)."""
        self._session.liveliness().declare_subscriber(
            expression,
            lambda sample: on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
            history=True,
        )

    def answer(self, topic: str, reply: Callable[[], bytes | None]) -> None:
        """Answer queries for a topic with what `reply` gives; None stays silent."""

        def on_query(query: zenoh.Query) -> None:
            payload = reply()
            if payload is not None:
                query.reply(topic, payload)

        self._session.declare_queryable(topic, on_query)

    def ask(self, topic: str, on_sample: OnSample) -> None:
        """Query a topic; answers come as samples."""

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                on_sample(topic, reply.ok.payload.to_bytes())

        self._session.get(topic, on_reply, timeout=2.0)

    def connected(self) -> bool:
        """Whether a client has its router."""
        return not self._session.is_closed() and bool(self._session.info.routers_zid())

    def check(self) -> None:
        """To be asked now and then by a client; raises BusError once the router has been away for LOST_AFTER_S."""
        if self.connected():
            self._away_since_s = None
            return
        now_s = time.monotonic()
        if self._away_since_s is None:
            self._away_since_s = now_s
        if now_s - self._away_since_s >= LOST_AFTER_S:
            raise BusError(f"the Zenoh router at {self._endpoint} is gone")


def _first_sentence(error: Exception) -> str:
    return str(error).split(" at /", 1)[0].split("\n", 1)[0]
