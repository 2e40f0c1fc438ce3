"""The gateway's process: the taps of a swarm on one side, connections to ground stations on the other."""

import asyncio
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, ConfigError, MalformedFrameError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.connections import Address, Connection, address_of
from fanet_mw.gateway.routing import Link, hostile
from fanet_mw.gateway.signing import Signing, read_key
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import START_PATIENCE_S, ClockListener, SwarmClock
from fanet_mw.hosts.readiness import tell_ready
from fanet_mw.hosts.timebase import THIS_MACHINE
from fanet_mw.mavlink import GATEWAY_COMPONENT, common
from fanet_mw.scenario.fingerprint import told_by
from fanet_mw.units import NodeId, seconds_to_ns
from fanet_mw.wire import frames, system_id

MOST_VEHICLES: Final = 250
"""System ids of vehicles; 251 to 255 are ground stations'."""
_ANSWER_S: Final = 3.0
_LOOK_S: Final = 0.5
_WORD_EVERY: Final = 20
"""Looks between two words about what did not pass."""
_PRESENT_EVERY: Final = 4
"""Looks between two heartbeats of the gateway."""
_SYSTEM: Final = 251
_NO_AUTOPILOT: Final = common.MAV_AUTOPILOT_INVALID
_ACTIVE: Final = common.MAV_STATE_ACTIVE
_MOST_WAITING: Final = 20_000
Tell = Callable[[str], None]


class Doors(NamedTuple):
    """Which connections are wanted, as the command line says it."""

    mavlink: tuple[str, ...] = ()
    per_uav: str | None = None
    """A connection for each UAV, its port ending in `+`: UAV 1 has that port, UAV 2 the next."""
    flavor: Flavor = Flavor.PX4
    key: Path | None = None
    in_band: bool | None = None
    """True: over the air, by the post on the ground; False: from all taps; None: over the air if there is a post."""

    def checked(self) -> "Doors":
        """Raises ConfigError for a connection that cannot be."""
        for text in self.mavlink:
            address_of(text)
        if self.per_uav is not None:
            per_uav(self.per_uav, 1)
        if self.key is not None:
            read_key(self.key)
        return self


def per_uav(text: str, node: int, *, flag: str = "--mavlink-per-uav") -> Address:
    """The connection of one UAV, whose port is counted up from that of UAV 1."""
    if not text.endswith("+"):
        raise ConfigError(f"{flag} {text}: must end with +, for example udpin:127.0.0.1:14540+")
    address = address_of(text[:-1], flag=flag)
    if address.kind == "serial":
        raise ConfigError(f"{flag} {text}: serial lines have no numbers to count up")
    port = address.port + node - 1
    if port > 65_535:
        raise ConfigError(f"{flag} {text}: UAV {node} would have port {port}, must be <= 65535")
    return address._replace(port=port)


class SwarmFacts(NamedTuple):
    """What a gateway must know of its swarm."""

    nodes: list[NodeId]
    until_ns: int
    post: NodeId | None


async def facts_of(bus: Bus, names: Topics, over: asyncio.Event) -> SwarmFacts | None:
    """What the keeper of the clock says of the swarm, None if `over` is set meanwhile; raises BusError without one,
    ConfigError for too many UAVs.
    """
    answers: deque[bytes] = deque()
    until_s = time.monotonic() + _ANSWER_S
    while not answers:
        bus.ask(names.scenario, lambda _, payload: answers.append(payload))
        asked_s = time.monotonic()
        while not answers and time.monotonic() < asked_s + _LOOK_S:  # Zenoh's thread fills it
            if over.is_set():
                return None
            await asyncio.sleep(0.01)
        if time.monotonic() > until_s:
            raise BusError(f"swarm {names.swarm} does not say what it is within {_ANSWER_S:g} s: is there one?")
    try:
        scenario = told_by(names.swarm, answers[0])
        count, until_ns = int(scenario["nodes"]["count"]), seconds_to_ns(float(scenario["duration_s"]))
        post = NodeId(count + 1) if scenario["ground"]["at_m"] else None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BusError(f"swarm {names.swarm} says what no swarm says: {error}") from error
    if count > MOST_VEHICLES:
        raise ConfigError(f"nodes.count = {count}: MAVLink has system ids for {MOST_VEHICLES} vehicles at most")
    return SwarmFacts([NodeId(node) for node in range(1, count + 1)], until_ns, post)


class Gateway:
    """The gateway of one swarm."""

    def __init__(self, bus: Bus, names: Topics, facts: SwarmFacts, doors: Doors, *, tell: Tell) -> None:
        self._bus, self._names, self._tell = bus, names, tell
        self._until_ns, nodes = facts.until_ns, facts.nodes
        in_band = facts.post is not None if doors.in_band is None else doors.in_band
        if in_band and facts.post is None:
            raise ConfigError("--in-band: the scenario has no post on the ground (ground.at_m)")
        self._post = facts.post if in_band else None
        self._node_of = {system_id(node): node for node in nodes}
        unix_ns = THIS_MACHINE.unix_ns()
        key = None if doors.key is None else read_key(doors.key)

        def opened(address: Address, of: Sequence[NodeId]) -> tuple[Link, Connection]:
            signing = None if key is None else Signing(key, unix_ns=unix_ns)
            if signing is not None:
                self._signings.append(signing)
            link = Link(str(address), of, flavor=doors.flavor, signing=signing, swarm=nodes)
            whole = address.kind.startswith("udp")
            return link, Connection(address, lambda peer, data: self._from_ground(link, peer, data, whole=whole))

        self._presence: Any = common.MAVLink(None, srcSystem=_SYSTEM, srcComponent=GATEWAY_COMPONENT)
        self._signings: list[Signing] = []
        self._doors = [opened(address_of(text), nodes) for text in doors.mavlink]
        if doors.per_uav is not None:
            self._doors += [opened(per_uav(doors.per_uav, node), (node,)) for node in nodes]
        self._heard: deque[tuple[str, bytes]] = deque()
        self._drain_asked = False
        self._counts: Counter[str] = Counter()
        """All counts when they were last told; only what has come since is told next."""
        self._own: Counter[str] = Counter()
        """The taps that reached no link: lost here, or malformed."""
        self._loop: asyncio.AbstractEventLoop | None = None

    async def serve(self, over: asyncio.Event) -> None:
        """Pass on what is said until `over` is set, or the swarm's time is over; raises BusError without a router."""
        self._loop = asyncio.get_running_loop()
        listener = ClockListener(self._bus, self._names)
        clock = asyncio.ensure_future(listener.running(timeout_s=START_PATIENCE_S))
        try:
            for _, connection in self._doors:
                await connection.open()
            self._bus.subscribe(self._names.mavlink(self._post or "*"), self._from_thread)
            way = "from the taps" if self._post is None else f"over the air by node {self._post}"
            self._tell(f"MAVLink {way} on " + ", ".join(str(connection.address) for _, connection in self._doors[:8])
                       + (f" and {len(self._doors) - 8} more" if len(self._doors) > 8 else ""))  # fmt: skip
            tell_ready()
            await self._watch(over, listener, clock)
        finally:
            clock.cancel()
            for _, connection in self._doors:
                connection.close()
            self._say_counts()

    async def _watch(self, over: asyncio.Event, listener: ClockListener, started: "asyncio.Future[SwarmClock]") -> None:
        looks = 0
        while not over.is_set() and not listener.stopped.is_set():
            clock = started.result() if started.done() else None
            if clock is not None and clock.wait_s(clock.ends_ns or self._until_ns) <= 0:
                return
            try:
                await asyncio.wait_for(over.wait(), _LOOK_S)
            except TimeoutError:
                self._bus.check()
            if looks % _PRESENT_EVERY == 0:
                self._tell_presence()
            unix_ns = THIS_MACHINE.unix_ns()
            for signing in self._signings:
                signing.follow(unix_ns)
            looks += 1
            if looks % _WORD_EVERY == 0:
                self._say_counts()

    def _tell_presence(self) -> None:
        """Let UAVs know that somebody may look at them: many ground stations say nothing before they have heard one."""
        heartbeat = common.MAVLink_heartbeat_message(
            common.MAV_TYPE_ONBOARD_CONTROLLER, _NO_AUTOPILOT, 0, 0, _ACTIVE, 3
        )
        frame = bytes(heartbeat.pack(self._presence))
        self._presence.seq = (self._presence.seq + 1) % 256
        for node in self._node_of.values() if self._post is None else (self._post,):
            self._bus.put(self._names.operator(node), codecs.encode([MavlinkTap(0, frame)]))

    def counts(self) -> dict[str, dict[str, int]]:
        """What has passed and what has not, for each link."""
        return {
            link.name: {**dict(sorted(link.counts.items())), "dropped": connection.dropped}
            for link, connection in self._doors
        }

    def _say_counts(self) -> None:
        now = self._own.copy()
        for link, _ in self._doors:
            now.update(link.counts)
        news = now - self._counts
        self._counts = now
        words = [*hostile(news)]
        if words:
            self._tell("did not pass: " + ", ".join(words))

    # --- from the swarm -------------------------------------------------------------------------------------------

    def _from_thread(self, topic: str, payload: bytes) -> None:
        """Called on Zenoh's thread."""
        if len(self._heard) >= _MOST_WAITING:
            self._own["lost_here"] += 1
            return
        self._heard.append((topic, payload))
        loop = self._loop
        if not self._drain_asked and loop is not None and not loop.is_closed():
            self._drain_asked = True
            loop.call_soon_threadsafe(self._drain)

    def _drain(self) -> None:
        self._drain_asked = False
        while self._heard:
            topic, payload = self._heard.popleft()
            try:
                taps = [message for message in codecs.decode(payload) if isinstance(message, MavlinkTap)]
                for node, data in self._by_node(int(topic.rpartition("/")[2]), b"".join(tap.data for tap in taps)):
                    for link, connection in self._doors:
                        shown = link.out(node, data)
                        if shown:
                            connection.send(shown)
            except (MalformedFrameError, ValueError):
                self._own["malformed_taps"] += 1

    def _by_node(self, node: int, data: bytes) -> Iterable[tuple[NodeId, bytes]]:
        """What each UAV has said, in what was tapped at a node: at the post, what it has heard from all."""
        if self._post is None:
            return ((NodeId(node), data),)
        said: dict[NodeId, bytes] = {}
        for frame in frames(data):
            of = self._node_of.get(frame[5])
            if of is not None:
                said[of] = said.get(of, b"") + frame
        return said.items()

    # --- from ground stations -------------------------------------------------------------------------------------

    def _from_ground(self, link: Link, peer: object, data: bytes, *, whole: bool) -> bytes:
        said, answer = link.into(peer, data, time.monotonic(), whole=whole)
        if self._post is None:
            for node, frames_ in said:
                self._bus.put(self._names.operator(node), codecs.encode([MavlinkTap(0, frames_)]))
        elif said:  # the post sees itself for whom a frame is
            together = b"".join(dict.fromkeys(frame for _, frames_ in said for frame in frames(frames_)))
            self._bus.put(self._names.operator(self._post), codecs.encode([MavlinkTap(0, together)]))
        return answer


async def serve(
    bus: Bus,
    names: Topics,
    doors: Doors,
    *,
    tell: Tell,
    over: asyncio.Event,
    on_started: Callable[[Any], None] = lambda _: None,
) -> None:
    """Run a gateway beside a swarm until it is over; raises BusError when the router is gone."""
    facts = await facts_of(bus, names, over)
    if facts is None:
        return
    gateway = Gateway(bus, names, facts, doors, tell=tell)
    on_started(gateway)
    await gateway.serve(over)
