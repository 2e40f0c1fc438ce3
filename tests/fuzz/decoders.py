"""Every decoder of what others send, fed with near misses of what is valid: one value or one error, and soon.

    corpus -> one thing changed -> decoder -> a value | MalformedFrameError

Inputs go round the decoders in turn. What is promised: nothing else is raised, no input takes long, memory does not
grow, and a value of the air comes back from its own encoding as it was. `decoders.py [INPUTS [SEED]]` is the long run.
"""

import gc
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import corpus
import mutations
from corpus import Corpus

from fanet_mw import mavlink, tlog, trace, wire
from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import MavlinkTap, Report, TraceBatch
from fanet_mw.errors import MalformedFrameError
from fanet_mw.radios.udp import Datagram
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.aodv import messages as aodv
from fanet_mw.routing.dsdv import messages as dsdv
from fanet_mw.routing.geographic import messages as geographic
from fanet_mw.routing.olsr import messages as olsr
from fanet_mw.wire import application_message as pieces
from fanet_mw.wire import rounds
from fanet_mw.wire.hello.beacon import Beacon, TimeBeacon
from fanet_mw.wire.hello.digest import Digest
from fanet_mw.wire.links import Links
from fanet_mw.wire.loads import Loads
from fanet_mw.wire.places import Places
from fanet_mw.wire.schedule import Join, Schedule
from fanet_mw.wire.search_messages import Roll, ToldOrder, checked_bids, told_in
from fanet_mw.wire.search_plan import Search, SearchStatus
from fanet_mw.wire.survivors import Found as FoundMessage
from fanet_mw.wire.survivors import Survivor
from sim.records.bus_checks import BusChecks

SLOW_S: Final = 0.5
"""Of processor time, the most that one input may cost; usual are microseconds."""
MOST_GROWTH_MB: Final = 200
"""Of the process over a long run."""
_HEADER: Final = wire.Header(12, 1, 3, 0xFFFF, 3, wire.Kind.DATA, 8, 0, 2, 0).encode()


class Decoder(NamedTuple):
    """One entry point for bytes of others."""

    name: str
    decode: Callable[[bytes], object]
    inputs: Callable[[Random], bytes]
    """One near miss."""


def decoders_of(found: Corpus, folder: Path) -> list[Decoder]:
    """All of them, the air first."""
    return [*_of_the_air(found), *_of_rivals(found), *_of_the_bus(found), *_of_telemetry(found, folder)]


def _of_the_air(found: Corpus) -> Iterator[Decoder]:
    by_message: dict[int, list[bytes]] = {}
    for frame in found.frames:
        for kind in {int.from_bytes(inner[7:10], "little") for inner in wire.frames(frame)}:
            by_message.setdefault(kind, []).append(frame)

    def of(msgid: int) -> Callable[[Random], bytes]:
        frames = by_message[msgid]
        return lambda pick: mutations.frame_changed(pick.choice(frames), found.frames, pick)

    def any_frame(pick: Random) -> bytes:
        return mutations.frame_changed(pick.choice(found.frames), found.frames, pick)

    def header(data: bytes) -> object:
        head = wire.decode_header(data)
        assert wire.decode_header(head.encode()) == head
        wire.rewrite(data, 7, 1, hop=min(head.hop_limit, 1))
        return head

    yield Decoder("routing header", header, of(wire.ROUTE.msgid))
    yield Decoder("bundle", wire.unbundle, any_frame)
    yield Decoder("inner frames", lambda data: list(wire.inner_frames(data)), any_frame)
    for kind, spec in (
        (Beacon, wire.BEACON), (Schedule, wire.SCHEDULE), (Survivor, wire.SURVIVOR), (TimeBeacon, wire.TIME),
        (Join, wire.JOIN), (FoundMessage, wire.FOUND),
    ):  # fmt: skip
        yield Decoder(kind.__name__, _there_and_back(kind.decode_frame, _encode_frame), of(spec.msgid))
    yield Decoder("Digest", _there_and_back(Digest.decode_frames, lambda m: m.encode_frames(3)), of(wire.DIGEST.msgid))
    yield Decoder("Links", _there_and_back(Links.decode_frames, lambda m: m.encode_frames()), of(wire.LINKS.msgid))
    yield Decoder("piece", _there_and_back(pieces.decode_piece, _encode_piece), of(wire.MESSAGE.msgid))
    yield Decoder(
        "receipts",
        _there_and_back(pieces.decode_receipts, lambda m: pieces.encode_receipts(m, node=3)),
        of(wire.RECEIPT.msgid),
    )
    for kind, spec in (
        (Search, wire.SEARCH),
        (SearchStatus, wire.STATUS),
        (Roll, wire.ROLL),
        (ToldOrder, wire.ORDER),
    ):
        yield Decoder(kind.__name__, _there_and_back(_first_told(kind), _encode_frame), of(spec.msgid))
    yield Decoder(
        "links in rounds",
        _there_and_back(rounds.decode_heard, lambda m: rounds.encode_heard(m, 3, count=rounds.MOST_NODES)),
        of(wire.HEARD.msgid),
    )
    yield Decoder(
        "held packets", _there_and_back(rounds.decode_held, lambda m: rounds.encode_held(m, 3)), of(wire.HELD.msgid)
    )
    yield Decoder("Bids", lambda data: checked_bids(wire.decode_first(wire.BIDS, data)), of(wire.BIDS.msgid))
    yield Decoder("Loads", _there_and_back(Loads.decode_frames, lambda m: m.encode_frames(3)), of(wire.LOADS.msgid))
    yield Decoder("Places", Places.decode_frames, of(wire.PLACES.msgid))
    yield Decoder("position", mavlink.kinematics_of, of(mavlink.common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT))
    yield Decoder("collision", mavlink.collision_of, of(mavlink.common.MAVLINK_MSG_ID_COLLISION))
    yield Decoder("datagram", Datagram.decode, lambda pick: mutations.scrambled(pick.choice(found.datagrams), pick))


def _first_told(kind: type) -> Callable[[bytes], object]:
    def decode(data: bytes) -> object:
        told = next((one for one in told_in(data) if isinstance(one, kind)), None)
        if told is None:
            raise MalformedFrameError(f"no {kind.__name__}")
        return told

    return decode


def _encode_frame(message: Any) -> bytes:
    return message.encode_frame(3)  # type: ignore[no-any-return]


def _encode_piece(piece: pieces.Piece) -> bytes:
    return pieces.encode_piece(piece.head, piece.data, node=3, targets=piece.targets or ())


def _there_and_back(decode: Callable[[bytes], Any], encode: Callable[[Any], bytes]) -> Callable[[bytes], object]:
    def both(data: bytes) -> object:
        message = decode(data)
        if message is not None:
            again = decode(_HEADER + encode(message))
            assert again == message, f"{message} comes back as {again}"
        return message

    return both


def _of_rivals(found: Corpus) -> Iterator[Decoder]:
    frames = [frame for frame in found.frames if corpus.kind_of(frame) == wire.Kind.ROUTING]

    def fragments(pick: Random) -> bytes:
        return mutations.frame_changed(pick.choice(frames), frames, pick)

    yield Decoder("control pieces", control.decode, fragments)
    messages: list[tuple[str, int, Any]] = [
        ("RREQ", 0x11, aodv.RouteRequest), ("RREP", 0x12, aodv.RouteReply), ("RERR", 0x13, aodv.RouteError),
        ("OLSR hello", 0x21, olsr.Hello), ("TC", 0x22, olsr.TopologyControl), ("DSDV update", 0x31, dsdv.Update),
        ("geographic beacon", 0x41, geographic.PositionBeacon), ("location", 0x42, geographic.Location),
        ("query", 0x43, geographic.Query),
    ]  # fmt: skip
    for name, kind, message in messages:
        bodies = [body for its_kind, body in found.control if its_kind == kind] or [_made(message).encode()]

        def body(pick: Random, bodies: Sequence[bytes] = bodies) -> bytes:
            return mutations.integers_changed(pick.choice(bodies), pick)

        def there_and_back(data: bytes, message: Any = message) -> object:
            value = message.decode(data)
            assert message.decode(value.encode()) == value or isinstance(value, olsr.Hello)  # which it sorts by code
            return value

        yield Decoder(name, there_and_back, body)


def _made(message: Any) -> Any:
    """A message that no run of the corpus said."""
    if message is aodv.RouteError:
        return aodv.RouteError((aodv.Unreachable(3, 7), aodv.Unreachable(4, 9)))
    if message is geographic.Query:
        return geographic.Query(3)
    raise AssertionError(f"no {message.__name__} was recorded")


def _of_the_bus(found: Corpus) -> Iterator[Decoder]:
    checks = BusChecks(corpus.scenario_of("all", "duration_s=30"))
    said = {kind: [put for put in found.puts if put[0] == code] for kind, code in codecs.CODES.items()}

    def put(pick: Random) -> bytes:
        first = mutations.put_changed(pick.choice(found.puts), pick)
        return first + pick.choice(found.puts) if pick.random() < 0.1 else first

    def of(kind: type[Any]) -> Callable[[Random], bytes]:
        return lambda pick: mutations.put_changed(pick.choice(said[kind]), pick)

    def checked(data: bytes) -> object:
        """What the collector of a run asks of each message, and what it says."""
        for message in codecs.decode(data):
            if isinstance(message, TraceBatch):
                for record in message.records:
                    for name in ("agent-3", "emulator", "world"):
                        checks.record(name, record)
            elif isinstance(message, MavlinkTap):
                checks.tap(message)
            elif isinstance(message, LinkStats):
                checks.links(message)
            elif isinstance(message, Report):
                for name in ("agent-3", "emulator", "world"):
                    content, wrong = checks.report(name, message.json)
                    assert not content or wrong is None
        return None

    yield Decoder("put", codecs.decode, put)
    for kind in codecs.CODES:
        yield Decoder(f"put of {kind.__name__}", codecs.decode, of(kind))
    for kind in _CHECKED:
        yield Decoder(f"{kind.__name__}, checked", checked, of(kind))
    lines = [line.encode() for line in found.lines]
    yield Decoder(
        "trace line",
        lambda data: trace.parse(data.decode(errors="replace")),
        lambda pick: mutations.text_changed(pick.choice(lines), pick),
    )


_CHECKED: Final = (TraceBatch, MavlinkTap, LinkStats, Report)


def _of_telemetry(found: Corpus, folder: Path) -> Iterator[Decoder]:
    taps = [put[13:] for put in found.puts if put[0] in codecs.codes_of(MavlinkTap)]
    path = folder / "mutated.tlog"

    def read(data: bytes) -> object:
        path.write_bytes(data)
        return list(tlog.read(path))

    def log(pick: Random) -> bytes:
        whole = b"".join(bytes(8) + tap for tap in pick.choices(taps, k=3))
        return mutations.scrambled(whole, pick)

    yield Decoder("telemetry", mavlink.decode, lambda pick: mutations.frame_changed(pick.choice(taps), taps, pick))
    yield Decoder("telemetry log", read, log)


# --- a run ----------------------------------------------------------------------------------------------------------


class Found(NamedTuple):
    """What one decoder did."""

    name: str
    inputs: int
    values: int
    slowest_s: float

    def __str__(self) -> str:
        slowest = f"slowest {self.slowest_s * 1e3:7.2f} ms"
        return f"{self.name:24} {self.inputs:8} inputs, {self.values:8} of them values, {slowest}"


class Wrong(NamedTuple):
    """An input that a decoder did not stand."""

    name: str
    data: bytes
    why: str

    def __str__(self) -> str:
        return f"{self.name}: bytes.fromhex({self.data.hex()!r})\n{self.why}"


def feed(decoder: Decoder, inputs: int, pick: Random) -> tuple[Found, list[Wrong]]:
    """Give one decoder so many near misses."""
    values, slowest_s, wrong = 0, 0.0, []
    clock = time.thread_time
    decode, make = decoder.decode, decoder.inputs
    for _ in range(inputs):
        data = make(pick)
        began_s = clock()
        try:
            decode(data)
            values += 1
        except MalformedFrameError:
            pass
        except Exception:  # noqa: BLE001  (this program reports whatever goes wrong)
            wrong.append(Wrong(decoder.name, data, traceback.format_exc(limit=-4)))
        took_s = clock() - began_s
        if took_s > slowest_s:
            slowest_s = took_s
            if took_s > SLOW_S:
                wrong.append(Wrong(decoder.name, data, f"took {took_s:.1f} s"))
        if len(wrong) > 3:
            break
    return Found(decoder.name, inputs, values, slowest_s), wrong


def main() -> int:
    inputs, seed = (int(sys.argv[at]) if len(sys.argv) > at else default for at, default in ((1, 10**7), (2, 0)))
    began_s, wrong, done = time.perf_counter(), 0, 0
    found = corpus.recorded()
    with tempfile.TemporaryDirectory() as folder:
        every = decoders_of(found, Path(folder))
        gc.collect()
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(f"{len(found.frames)} frames, {len(found.puts)} puts, {len(every)} decoders")
        for decoder in every:
            share = 1 if decoder.name != "telemetry log" else 0.05  # it goes over a file
            count = max(1, round(share * inputs / (len(every) - 0.95)))
            row, bad = feed(decoder, count, Random(f"{seed}/{decoder.name}"))
            done += row.inputs
            wrong += len(bad)
            print(row, flush=True)
            for item in bad:
                print(item, flush=True)
        grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1024
    took_s = time.perf_counter() - began_s
    print(f"{done} inputs in {took_s:.0f} s, {wrong} with something wrong, memory grew by {grown_mb:.0f} MB")
    return int(wrong > 0 or grown_mb > MOST_GROWTH_MB)


if __name__ == "__main__":
    sys.exit(main())
