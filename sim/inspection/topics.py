"""`fanet topic`: what is put on the topics of a swarm, as lines."""

import json
import math
import queue
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from itertools import pairwise
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.bus import codecs
from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.mavlink import decode
from sim.bus.operator_commands import OPERATOR, find_swarm
from sim.console import Console, table

_LOOK_S: Final = 0.5
_MOST_WAITING: Final = 50_000
_PART: Final = re.compile(r"\*\*?|[^*$#?]+")
_FRAMES: Final = ("frame", "data")
"""Fields that hold MAVLink frames."""


class Malformed(NamedTuple):
    """A put that holds no messages of the bus."""

    why: str


class Heard:
    """What is put on some topics, with the instant at which it came; what does not fit is counted."""

    def __init__(self, endpoint: str, swarm: str | None, name: str, zenoh_config: Path | None) -> None:
        if not all(_PART.fullmatch(part) for part in name.split("/")):
            raise ConfigError(f"topic {name!r}: must be parts between slashes, each a name, * or **")
        self.lost = 0
        self._bus = Bus.join(endpoint, config_of(zenoh_config, OPERATOR))
        self._puts: queue.Queue[tuple[float, str, bytes]] = queue.Queue(_MOST_WAITING)
        try:
            self.swarm = Topics(swarm or find_swarm(self._bus)).swarm
            self.base = f"{ROOT}/{self.swarm}/"
            self._bus.subscribe(name if name.startswith(f"{ROOT}/") else self.base + name, self._keep)
        except BaseException:
            self._bus.close()
            raise

    def _keep(self, topic: str, payload: bytes) -> None:
        try:
            self._puts.put_nowait((time.monotonic(), topic, payload))
        except queue.Full:
            self.lost += 1

    def puts(self, until_s: float = math.inf) -> Iterator[tuple[float, str, bytes] | None]:
        """Each put as it comes; None where nothing came for a while. Raises BusError when the router is gone."""
        try:
            while time.monotonic() < until_s:
                try:
                    yield self._puts.get(timeout=min(_LOOK_S, max(0.01, until_s - time.monotonic())))
                except queue.Empty:
                    self._bus.check()
                    yield None
        finally:
            self._bus.close()


def show_list(endpoint: str, swarm: str | None, *, seconds: float, zenoh_config: Path | None) -> int:
    heard = Heard(endpoint, swarm, "**", zenoh_config)
    counts: Counter[str] = Counter()
    size: Counter[str] = Counter()
    kinds: dict[str, set[str]] = {}
    for put in heard.puts(time.monotonic() + seconds):
        if put is None:
            continue
        _, topic, payload = put
        counts[topic] += 1
        size[topic] += len(payload)
        if len(kinds.setdefault(topic, set())) < 4:
            kinds[topic] |= {type(message).__name__ for message in decoded(payload)}
    shown = table(("topic", "messages", "Hz", "B/s"))
    for topic in sorted(counts, key=_by_number):
        name = topic.removeprefix(heard.base)
        shown.add_row(
            name, " ".join(sorted(kinds[topic])), f"{counts[topic] / seconds:.1f}", f"{size[topic] / seconds:.0f}"
        )
    Console().print(shown if counts else f"nothing was said on {heard.base}** within {seconds:g} s")
    return 0


def show_echo(endpoint: str, swarm: str | None, *, name: str, count: int | None, zenoh_config: Path | None) -> int:
    heard, shown = Heard(endpoint, swarm, name, zenoh_config), 0
    for put in heard.puts():
        for message in decoded(put[2]) if put is not None else ():
            sys.stdout.write(
                json.dumps({"topic": put[1] if put else "", type(message).__name__: plain(message)}) + "\n"
            )
            shown += 1
            if shown == count:
                return 0
        sys.stdout.flush()
    return 0


def show_rate(
    endpoint: str, swarm: str | None, *, name: str, count: int | None, zenoh_config: Path | None, of_bytes: bool
) -> int:
    """One line a second: how often something is put, or how many bytes."""
    heard, shown, window = Heard(endpoint, swarm, name, zenoh_config), 0, list[tuple[float, int]]()
    due_s = time.monotonic() + 1
    for put in heard.puts():
        if put is not None:
            window.append((put[0], len(put[2])))
        now_s = time.monotonic()
        if now_s < due_s:
            continue
        due_s += max(1.0, math.ceil(now_s - due_s))
        window = [entry for entry in window if entry[0] > now_s - 10]
        sys.stdout.write(
            (bandwidth if of_bytes else rate)(window) + (f", {heard.lost} lost" if heard.lost else "") + "\n"
        )
        sys.stdout.flush()
        shown += 1
        if shown == count:
            break
    return 0


def rate(window: list[tuple[float, int]]) -> str:
    """How often something was put, as `ros2 topic hz` says it."""
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(window)]
    if not gaps or not sum(gaps):
        return f"no rate yet: {len(window)} puts"
    return (
        f"average rate: {1 / fmean(gaps):.3f}  min: {min(gaps):.3f}s max: {max(gaps):.3f}s "
        f"std dev: {pstdev(gaps):.5f}s window: {len(window)}"
    )


def bandwidth(window: list[tuple[float, int]]) -> str:
    if len(window) < 2:
        return f"no bandwidth yet: {len(window)} puts"
    span_s, sizes = window[-1][0] - window[0][0], [size for _, size in window]
    per_s = sum(sizes[1:]) / span_s if span_s else 0.0
    return f"{per_s:.0f} B/s  mean: {fmean(sizes):.0f} B min: {min(sizes)} B max: {max(sizes)} B window: {len(window)}"


def decoded(payload: bytes) -> list[Any]:
    try:
        return list(codecs.decode(payload))
    except MalformedFrameError as error:
        return [Malformed(str(error))]


def _by_number(topic: str) -> list[tuple[int, str]]:
    """Node 10 after node 9."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in topic.split("/")]


def plain(value: Any) -> Any:  # noqa: ANN401  (whatever is on the bus)
    """A message as JSON values, MAVLink frames decoded."""
    if hasattr(value, "_asdict"):
        return {key: _frames(part) if key in _FRAMES else plain(part) for key, part in value._asdict().items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {key: plain(part) for key, part in asdict(value).items()}
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, str | int | bool) or value is None:
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    if hasattr(value, "__iter__"):
        return [plain(part) for part in value]
    return str(value)


def _frames(data: object) -> object:
    if not isinstance(data, bytes):
        return plain(data)
    try:
        return [plain_mavlink(message) for frame in wire.frames(data) for message in decode(frame)]
    except MalformedFrameError:
        return data.hex()


def plain_mavlink(message: Any) -> dict[str, Any]:  # noqa: ANN401  (pymavlink has no types)
    found = {"system": message.get_srcSystem(), "component": message.get_srcComponent(), "message": message.get_type()}
    for name in message.get_fieldnames():
        found[name] = plain(getattr(message, name))
    return found
