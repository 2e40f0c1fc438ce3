"""A Zenoh session with the settings that a swarm needs, as a context manager that always closes it.

Scouting is off: it is configured which process connects to which. Frames, poses and sensor readings are best effort and
dropped under congestion, because late ones are worse than lost ones, and gaps are counted. Traces and reports are
reliable.
"""

import asyncio
import base64
import contextlib
import json
import os
import re
import socket
import ssl
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final, Protocol, Self

import zenoh

from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts.timebase import THIS_MACHINE

JOIN_PATIENCE_S: Final = 2.5
"""How long a process waits for a router by default; it is short, so that a mistyped endpoint is soon reported."""
BUSY_PATIENCE_S: Final = 10.0
"""How much longer a process waits for a router whose port accepts connections: its machine may be busy."""
MAX_PUT_BYTES: Final = 16 << 20
"""The first session that receives a longer put drops it; Zenoh's default would collect up to 1 GiB."""
LOST_AFTER_S: Final = 2.0
"""A router silent for so long counts as gone; to one that returns earlier, Zenoh reconnects by itself."""
_ANSWERED_S: Final = 2.0
"""How long a query waits for answers."""
_RUNTIME_VARIABLE: Final = "ZENOH_RUNTIME"
"""The environment variable from which Zenoh reads its threads when a process opens its first session."""
_ONE_RUNTIME: Final = (
    "(app: (worker_threads: 1), rx: (handover: app), tx: (handover: app), net: (handover: app), acc: (handover: app))"
)
"""A client's receiving and sending share one thread, where by default five threads wake each other for each message:
with 45 sessions on two cores, a quarter fewer switches between threads (17,000 of 23,000 each second). A router keeps
Zenoh's own threads: what it receives from one session may have to wait until it has sent to another."""
_ROOT: Final = re.compile(r"""root_ca_certificate(_base64)?["']?\s*:\s*["']([^"']+)""")
"""The certificate by which others are checked, in a configuration file; Zenoh itself does not tell it again."""
OnSample = Callable[[str, bytes], None]
"""A callback with topic and payload; Zenoh calls it on a thread of its own."""


class HostBus(Protocol):
    """The part of the bus that a host needs; `Bus` has it, and so has a bus that keeps some topics to itself."""

    def subscribe(self, expression: str, on_sample: OnSample) -> None: ...

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None: ...

    def announce(self, topic: str) -> None: ...

    def ask(self, topic: str, on_sample: OnSample) -> None: ...

    def check(self) -> None: ...


def config_of(path: Path | None, name: str) -> Path | None:
    """The Zenoh configuration file of a process: `path` itself, or NAME.json5 in it if it is a folder."""
    return path / f"{name}.json5" if path is not None and path.is_dir() else path


def exposure(endpoint: str, *, listens: bool) -> str | None:
    """A warning if others can reach or forge messages on an endpoint; None for the loopback interface, TLS and QUIC."""
    protocol, slash, _ = endpoint.partition("/")
    if not slash:
        return None  # it is refused before anything is opened
    host, _ = _host_and_port(endpoint)
    if protocol in ("tls", "quic", "unixsock-stream", "unixpipe") or host == "localhost":
        return None
    with contextlib.suppress(ValueError):
        if ip_address(host).is_loopback:
            return None
    who = "whoever reaches it" if listens else "whoever is on the way"
    return (
        f"{endpoint} is neither on the loopback interface nor encrypted: {who} can stop the clock, move UAVs, change "
        f"the air and forge results. tls/ with access lists keeps them out: `fanet keys` makes both, for --zenoh-config"
    )


def with_port(endpoint: str) -> str:
    """The endpoint to listen on, with a port that is free now in place of port 0; others must be told which it is."""
    head, _, rest = endpoint.partition("#")
    address, port, number = head.rpartition(":")
    if not port or number != "0":
        return endpoint
    host = address.partition("/")[2].strip("[]")
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family) as probe:
            probe.bind((host, 0))
            free = probe.getsockname()[1]
    except OSError as error:
        raise BusError(f"cannot serve on {endpoint}: {error.strerror}") from error
    return f"{address}:{free}" + (f"#{rest}" if rest else "")


def _require_endpoint(endpoint: str) -> None:
    """Raise ConfigError for what is no endpoint; what a protocol makes of the address, Zenoh says."""
    protocol, slash, address = endpoint.partition("/")
    if not (protocol and slash and address):
        example = f"tcp/{endpoint}" if endpoint and not slash else "tcp/127.0.0.1:7447"
        raise ConfigError(f"endpoint {endpoint!r}: must be PROTOCOL/ADDRESS, for example {example}")


def _config(
    *, mode: str, listen: str | None, connect: str | None, file: Path | None, patience_s: float = 0.0
) -> zenoh.Config:
    """The settings of this module over those of a Zenoh configuration file; raises ConfigError when it is unusable."""
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
        # Some seconds after it was opened each session would map and zero 16 MB of shared memory, all at the same time:
        # 45 sessions stall two cores for half a second in the middle of a run. Frames are too small to gain from it.
        "transport/shared_memory/enabled": False,
        # One wake-up of the medium makes one put for each UAV, all at once: there must be room and time for them.
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
        """Open a session as the router; the file adds TLS and access lists. Raises BusError and ConfigError."""
        _require_endpoint(endpoint)
        settings = _config(mode="router", listen=endpoint, connect=None, file=config)
        if endpoint.startswith("tls/") and (off := _clock_outside_certificate(config)) is not None:
            raise BusError(f"cannot serve on {endpoint}: {off}")
        try:
            return cls(zenoh.open(settings), endpoint)
        except zenoh.ZError as error:
            why = "it is already in use" if "in use" in str(error) else _first_sentence(error)
            raise BusError(f"cannot serve on {endpoint}: {why}") from error

    @classmethod
    def join(cls, endpoint: str, config: Path | None = None, *, patience_s: float = JOIN_PATIENCE_S) -> Self:
        """Open a session as a client of a router; raises BusError when none answers, ConfigError for an unusable file.
        On a busy machine a handshake may take seconds, so a launched process has more patience.
        """
        joining = _Joining(endpoint, config, patience_s)
        while True:
            try:
                return cls(_opened(joining.settings()), endpoint)
            except zenoh.ZError as error:
                joining.failed(error)

    @classmethod
    async def join_on_loop(
        cls, endpoint: str, config: Path | None = None, *, patience_s: float = JOIN_PATIENCE_S
    ) -> Self:
        """As `join`, while the event loop goes on: signals that it handles reach who waits, and cancel the wait."""
        joining = _Joining(endpoint, config, patience_s)
        while True:
            opening = _opening(joining.settings())
            try:
                return cls(await asyncio.wrap_future(opening), endpoint)
            except zenoh.ZError as error:
                joining.failed(error)
            except asyncio.CancelledError:
                _abandon(opening)
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the session; a process that omits this would hang at its exit."""
        self._publishers.clear()
        if self._session.is_closed():
            return
        with contextlib.suppress(zenoh.ZError):  # a router that is frozen does not answer the closing of a session
            self._session.close()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it

    def subscribe(self, expression: str, on_sample: OnSample) -> None:
        """Receive what is put on a key expression, as long as the session lasts; raises BusError without a thread."""
        try:
            self._session.declare_subscriber(
                expression, lambda sample: on_sample(str(sample.key_expr), sample.payload.to_bytes())
            )
        except RuntimeError as error:
            raise BusError(f"cannot listen to {expression}: {error} (see ulimit -u and ulimit -v)") from error

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None:
        """Publish; without a router the put is dropped (see `check`). Raises BusError on a closed session."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            control = zenoh.CongestionControl.BLOCK if reliable else zenoh.CongestionControl.DROP
            if self._session.is_closed():
                raise BusError(f"cannot put on {topic}: the session with {self._endpoint} is closed")
            # Not express: under pressure Zenoh then packs many puts into one of its few send buffers. As express, a
            # burst of small puts fills the buffers and the rest is dropped (0.4 % of the frames of 45 agents, 2 cores).
            publisher = self._publishers[topic] = self._session.declare_publisher(
                topic, congestion_control=control, express=False
            )
        publisher.put(payload)

    def announce(self, topic: str) -> None:
        self._tokens.append(self._session.liveliness().declare_token(topic))

    def watch(self, expression: str, on_change: Callable[[str, bool], None]) -> None:
        """Report liveliness tokens that appear and go, and those that exist already: (topic, alive)."""
        self._session.liveliness().declare_subscriber(
            expression,
            lambda sample: on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
            history=True,
        )

    def answer(self, topic: str, reply: Callable[[], bytes | None]) -> None:
        """Answer queries on a topic with what `reply` returns; if it returns None, no answer is sent."""

        def on_query(query: zenoh.Query) -> None:
            payload = reply()
            if payload is not None:
                query.reply(topic, payload)

        self._session.declare_queryable(topic, on_query)

    def ask(self, topic: str, on_sample: OnSample) -> None:
        """Query a topic; each answer comes with the topic of who answers. On a closed session no query is made."""

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                on_sample(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

        if not self._session.is_closed():
            self._session.get(topic, on_reply, timeout=_ANSWERED_S, consolidation=zenoh.ConsolidationMode.NONE)

    def is_answered(self, topic: str) -> bool:
        """True if somebody answers queries on a topic; waits for an answer, at most as long as for those of `ask`."""
        return any(reply.ok is not None for reply in self._session.get(topic, timeout=_ANSWERED_S))

    def connected(self) -> bool:
        """True if a client has its router."""
        return not self._session.is_closed() and bool(self._session.info.routers_zid())

    def check(self) -> None:
        """Raise BusError if the router has been away for LOST_AFTER_S; a client calls this regularly."""
        if self.connected():
            self._away_since_s = None
            return
        now_s = time.monotonic()
        if self._away_since_s is None:
            self._away_since_s = now_s
        if now_s - self._away_since_s >= LOST_AFTER_S:
            raise BusError(f"the Zenoh router at {self._endpoint} is gone")


def _clock_outside_certificate(config: Path | None) -> str | None:
    """Why no handshake can succeed at this machine's time (Zenoh reports that like a silent router); or None."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with contextlib.suppress(OSError, ValueError):
        for base64_, given in _ROOT.findall(config.read_text(encoding="utf-8") if config else ""):
            content = base64.b64decode(given).decode("ascii") if base64_ else Path(given).read_text("ascii")
            context.load_verify_locations(cadata=content)
    now_s = THIS_MACHINE.unix_ns() / 1e9
    for certificate in context.get_ca_certs():
        since, until = str(certificate["notBefore"]), str(certificate["notAfter"])
        if not ssl.cert_time_to_seconds(since) <= now_s <= ssl.cert_time_to_seconds(until):
            now = time.strftime("%b %d %H:%M:%S %Y GMT", time.gmtime(now_s))
            return f"the clock of this machine says {now}, and its certificates are valid from {since} to {until}"
    return None


class _Joining:
    """The attempts to open a session with one router: the settings of the next, and when to give up."""

    def __init__(self, endpoint: str, config: Path | None, patience_s: float) -> None:
        _require_endpoint(endpoint)
        os.environ.setdefault(_RUNTIME_VARIABLE, _ONE_RUNTIME)
        self._endpoint, self._config, self._patience_s = endpoint, config, patience_s
        self._waited_s, self._listens = 0.0, False

    def settings(self) -> zenoh.Config:
        self._waited_s += self._patience_s
        return _config(
            mode="client", listen=None, connect=self._endpoint, file=self._config, patience_s=self._patience_s
        )

    def failed(self, error: zenoh.ZError) -> None:
        """An attempt has failed; raises BusError unless another one makes sense."""
        endpoint = self._endpoint
        if not self._listens and _somebody_listens(endpoint):
            self._listens, self._patience_s = True, BUSY_PATIENCE_S
            return
        if (off := _clock_outside_certificate(self._config)) is not None:
            raise BusError(f"no Zenoh router at {endpoint}: {off}") from error
        why = "no answer" if "onnect" in str(error) else _first_sentence(error)
        raise BusError(
            f"no Zenoh router at {endpoint} ({why} within {self._waited_s:g} s"
            f"{', although somebody listens there' if self._listens else ''}); "
            f"start one with `fanet router SCENARIO` or `fanet launch SCENARIO`, and --listen {endpoint}"
        ) from error


def _opening(settings: zenoh.Config) -> Future[zenoh.Session]:
    """A session, opened on a thread of its own, because no signal interrupts Zenoh while it waits for a router. After
    the future was canceled it is closed as soon as it is open.
    """
    opening: Future[zenoh.Session] = Future()

    def work() -> None:
        try:
            session = zenoh.open(settings)
        except Exception as error:  # noqa: BLE001  (raised where the session is waited for)
            if opening.set_running_or_notify_cancel():
                opening.set_exception(error)
            return
        if opening.set_running_or_notify_cancel():
            opening.set_result(session)
        else:
            session.close()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it

    threading.Thread(target=work, name="opens a session", daemon=True).start()
    return opening


def _opened(settings: zenoh.Config) -> zenoh.Session:
    """A session; a signal interrupts the wait for it."""
    opening = _opening(settings)
    try:
        return opening.result()
    except KeyboardInterrupt:
        _abandon(opening)
        raise


def _abandon(opening: Future[zenoh.Session]) -> None:
    """Nobody waits for this session any more: close it now, or once it is open."""
    if not opening.cancel() and opening.exception() is None:
        opening.result().close()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it


def _somebody_listens(endpoint: str) -> bool:
    """True if a TCP port accepts connections. TLS is not tried: its certificate may be what is refused."""
    if not endpoint.startswith("tcp/"):
        return False
    host, port = _host_and_port(endpoint)
    with contextlib.suppress(OSError, ValueError), socket.create_connection((host, int(port)), timeout=1):
        return True
    return False


def _host_and_port(endpoint: str) -> tuple[str, str]:
    host, _, port = endpoint.partition("/")[2].partition("#")[0].partition("?")[0].rpartition(":")
    return host.strip("[]"), port


def _first_sentence(error: Exception) -> str:
    """What a user needs of an error of Zenoh's. For a file that is no JSON5: the place, and what is expected there."""
    lines = [line.strip(" |=") for line in str(error).split(" at /", 1)[0].splitlines()]
    return ": ".join([lines[0], lines[-1]] if lines[0].startswith("-->") else lines[:1])
