"""Reads the folder of a run, whoever has made it.

    summary.json     the types and bounds of all that a page shows, and the size and digest of every other file
    the other files  regular ones in the folder itself, and the very ones that were written beside the summary
    scenario.toml    checked as every scenario is, but no part of another package that it names is imported
    trace.jsonl      records of nodes and instants that the scenario has, one line at a time

Everything else is a ConfigError of one line. What is forged consistently cannot be told from a run.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from fanet_mw import tlog
from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.foreign_file import json_of, open_regular, read_regular, toml_of
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.tables.world import FILE_KEYS
from fanet_mw.scenario.validation_errors import without_removed_defaults
from fanet_mw.trace import Record, name_of, parse
from sim.records.bus_checks import BusChecks, Count, Number, Share
from sim.results.file_names import LINKS_FILE, REPORTS_FILE, SCENARIO_FILE, SUMMARY_FILE, TLOG_FILE, TRACE_FILE

_MOST_BYTES: Final = 1 << 28
"""The greatest size of a file that is read at once; the links of a thousand UAVs take half as much."""
_LONGEST_LINE: Final = 4096
_SHORT: Final = 120
R = TypeVar("R", bound=Record)
Measured = Number | None
Text = Annotated[str, Field(max_length=10_000)]
_Node = Annotated[int, Field(ge=1, le=0xFFFF)]
_Copies = Annotated[int, Field(ge=0, le=1 << 40)]


class _ShownShape(BaseModel):
    """The keys that are read must be present; all others are kept."""

    model_config = ConfigDict(extra="allow", strict=True)


class _ShownDelay(_ShownShape):
    p50: Measured
    p95: Measured
    max: Measured


class _ShownPackets(_ShownShape):
    generated: Count
    pdr: Share | None
    delay_ms: _ShownDelay


class _ShownBound(_ShownShape):
    within_share: Share | None
    stated_share: Share | None = None
    violations: Count = 0
    overtaken: Count = 0
    worst_ms: Measured
    observed_max_ms: Measured


class _ShownAir(_ShownShape):
    busy: Measured = None
    pdr: Share | None = None


class _ShownLateness(_ShownShape):
    late_frames: Count
    frames: Count
    share: Share
    limit: Share
    p50_ms: Number
    p99_ms: Number
    max_ms: Number


class _ShownNearest(_ShownShape):
    least: Measured
    p1: Measured
    p50: Measured


class _ShownUsual(_ShownShape):
    p50: Number
    most: Number


class _ShownMission(_ShownShape):
    survivors: Count
    detected: Count
    approached: Count
    reached: Count
    confirmed: Count
    mistaken: Count
    reopened: Count
    time_to_confirm_s: list[Number]
    confirmed_error_m: Measured
    collisions: Count
    coverage: Share | None
    covered_95_s: Measured
    photographed: Share | None = None
    connected: Share | None
    connected_by_distance: Share | None = None
    biconnected: Share | None = None
    cut_vertices: _ShownUsual | None = None
    diameter: _ShownUsual | None = None
    nearest_m: _ShownNearest | dict[str, None] | None


class _ShownFile(_ShownShape):
    bytes: Count
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class _ShownSummary(_ShownPackets):
    valid: bool
    invalid_because: list[Text]
    scenario: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    nodes: Count
    mode: Literal["virtual", "realtime"]
    time_scale: Measured
    simulated_s: Annotated[float, Field(ge=0, le=1e9)]
    wall_s: Number = 0.0
    epoch_unix_ns: Annotated[int, Field(ge=0, le=1 << 62)] = 0
    aborted: Text | None = None
    slowed: list[Any]
    reports: _ShownPackets
    bound: _ShownBound | dict[str, None]
    air: _ShownAir
    lateness: _ShownLateness
    mission: _ShownMission
    unwritten: dict[str, Text]
    files: dict[str, _ShownFile]


class _ShownLink(_ShownShape):
    src: _Node
    dst: _Node
    copies: _Copies
    received: _Copies
    lost: dict[str, _Copies] = {}
    rssi_dbm: Annotated[float, Field(ge=-400, le=400)] | None = None


class _ShownTurns(_ShownShape):
    start_ms: Number
    period_ms: Annotated[float, Field(gt=1e-3, le=1e9)]
    contention_ms: Number = 0.0


class _ShownOwnTurns(_ShownTurns):
    turn_ms: Number
    own: list[Count]


class _ShownOwnSlots(_ShownTurns):
    slot_ms: Annotated[float, Field(gt=1e-3, le=1e9)]
    guard_ms: Number


class _ShownReport(_ShownShape):
    turns: _ShownOwnTurns | dict[str, None] | None = None
    slots: _ShownOwnSlots | dict[str, None] | None = None
    role: str | None = None
    cluster: Annotated[int, Field(ge=-1, le=2**16)] | None = None


_LINKS: Final = TypeAdapter(list[_ShownLink], config=ConfigDict(strict=True))
_REPORTS: Final = TypeAdapter(dict[str, dict[str, Any]], config=ConfigDict(strict=True))
SHOWN_REPORT: Final = TypeAdapter(_ShownReport)
_AGENTS: Final = TypeAdapter(dict[str, _ShownReport], config=ConfigDict(strict=True))


def holds_run(folder: Path) -> bool:
    """True for a folder of `fanet simulate --out` or `fanet launch --out`."""
    return os.path.lexists(folder / SUMMARY_FILE)  # the first file of a run, and of nothing else


class RunFolder:
    """The files of one run; every method raises ConfigError for what cannot be used."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / SUMMARY_FILE
        self.text = read_regular(path, most_bytes=_MOST_BYTES, follow=False)
        self.summary: Mapping[str, Any] = json_of(self.text, source=str(path))
        if isinstance(self.summary, dict) and not self.summary.get("files", True) and not self.summary.get("valid"):
            raise ConfigError(f"{folder}: the run did not end, so its files are not whole; run it again with --force")
        found = checked(TypeAdapter(_ShownSummary), self.summary, path)
        if found.valid != (not found.invalid_because) or (found.valid and found.unwritten):
            raise ConfigError(f"{path}: valid = {found.valid} contradicts invalid_because or unwritten")
        self._files = found.files

    @cached_property
    def scenario(self) -> Scenario:
        path = self.folder / SCENARIO_FILE
        tree = toml_of(self._read(SCENARIO_FILE), source=str(path))
        given = tree.get("world")
        world = given if isinstance(given, dict) else {}
        for key in FILE_KEYS:
            name = world.get(key)
            if isinstance(name, str) and name:
                if "/" in name or (self.folder / name).is_symlink():
                    raise ConfigError(f"{path}: world.{key} = {name[:_SHORT]!r} is no file of this folder")
                world[key] = str(self.folder.absolute() / name)
        scenario = config.build(without_removed_defaults(tree), source=str(path), imports=False)
        said = tuple(self.summary[key] for key in ("scenario", "seed", "nodes"))
        if said != (scenario.name, scenario.seed, scenario.nodes.count):
            raise ConfigError(f"{path}: is of another run than {SUMMARY_FILE}")
        return scenario

    def links(self) -> Sequence[Mapping[str, Any]]:
        found: Sequence[Mapping[str, Any]] = self._json(LINKS_FILE, _LINKS, missing=[])
        return found

    def agents(self) -> dict[int, Mapping[str, Any]]:
        """The last report of each UAV, by node id."""
        found: Mapping[str, Mapping[str, Any]] = self._json(REPORTS_FILE, _AGENTS, missing={})
        names = {f"agent-{node}": node for node in self.scenario.node_ids}
        return {names[name]: report for name, report in found.items() if name in names}

    def reports(self) -> Mapping[str, Mapping[str, Any]]:
        """The last report of each actor, by its name."""
        found: Mapping[str, Mapping[str, Any]] = self._json(REPORTS_FILE, _REPORTS, missing={})
        return found

    def records(self, *kinds: type[R]) -> Iterator[R]:
        """The records of these kinds, or of all, in the order of the trace."""
        said, digest, size = self._said(TRACE_FILE), hashlib.sha256(), 0
        checks, path = BusChecks(self.scenario), self.folder / TRACE_FILE
        for number, (line, record) in enumerate(_lines(path, kinds, size=said.bytes), start=1):
            digest.update(line)
            size += len(line)
            if record is not None:
                if (wrong := checks.named(record)) is not None:
                    raise ConfigError(f"{path}, line {number}: a record with a wrong {wrong}")
                yield record  # type: ignore[misc]  # the kinds are those that were asked for
        self._compare(TRACE_FILE, size, digest.hexdigest())

    def telemetry(self) -> Iterator[tuple[int, bytes]]:
        """The frames of `mavlink.tlog`, each with its instant in microseconds of unix time; none if it is not whole."""
        if TLOG_FILE not in self._files or TLOG_FILE in self.summary["unwritten"]:
            return
        path = self.folder / TLOG_FILE
        with open_regular(path, follow=False) as file:
            digest = hashlib.sha256()
            while part := file.read(1 << 20):
                digest.update(part)
            self._compare(TLOG_FILE, file.tell(), digest.hexdigest())
            file.seek(0)
            try:
                yield from tlog.read_from(file, source=str(path))
            except MalformedFrameError as error:
                raise ConfigError(str(error)) from error

    def _json(self, name: str, shape: TypeAdapter[Any], *, missing: Any) -> Any:  # noqa: ANN401  (JSON of a run)
        if name not in self._files or name in self.summary["unwritten"]:
            return missing
        path = self.folder / name
        content = json_of(self._read(name), source=str(path))
        checked(shape, content, path)
        return content

    def _read(self, name: str) -> bytes:
        data = read_regular(self.folder / name, most_bytes=_MOST_BYTES, follow=False)
        self._compare(name, len(data), hashlib.sha256(data).hexdigest())
        return data

    def _said(self, name: str) -> _ShownFile:
        if name not in self._files:
            raise ConfigError(f"{self.folder / name}: {SUMMARY_FILE} does not say that it was written")
        said: _ShownFile = self._files[name]
        return said

    def _compare(self, name: str, size: int, digest: str) -> None:
        said = self._said(name)
        if (size, digest) != (said.bytes, said.sha256):
            had = f"{size} bytes, not {said.bytes}" if size != said.bytes else "another digest"
            raise ConfigError(f"{self.folder / name}: is not the file that was written with {SUMMARY_FILE}: {had}")


def read_trace(folder: Path, *kinds: type[R]) -> Iterator[R]:
    """The records of these kinds, or all, whatever else the folder has; raises ConfigError that names a wrong line."""
    for _, record in _lines(folder / TRACE_FILE, kinds):
        if record is not None:
            yield record  # type: ignore[misc]  # the kinds are those that were asked for


def _lines(path: Path, kinds: Sequence[type[Any]], *, size: int | None = None) -> Iterator[tuple[bytes, Record | None]]:
    """The lines of a trace, each with its record if it is of these kinds; lines of other kinds are not parsed."""
    beginnings = tuple(f'["{name_of(kind)}",'.encode() for kind in kinds) or (b"[",)
    number = 0
    try:
        with open_regular(path, follow=False) as lines:
            has = os.fstat(lines.fileno()).st_size
            if size is not None and size != has:
                raise ConfigError(f"{path}: is not the file that was written with {SUMMARY_FILE}: {has} bytes, "
                                  f"not {size}")  # fmt: skip
            while line := lines.readline(_LONGEST_LINE):
                number += 1
                wanted = line.startswith(beginnings) or not line.startswith(b'["')
                yield line, parse(line.decode("utf-8")) if wanted else None
    except MalformedFrameError as error:
        raise ConfigError(f"{path}, line {number}: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}, line {number}: cannot be read: {error}") from error


def checked(shape: TypeAdapter[Any], content: object, path: Path) -> Any:  # noqa: ANN401  (the type of the shape)
    """The content of a file in this shape; raises ConfigError with the first mistake."""
    try:
        return shape.validate_python(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        value, key = repr(first["input"]), ".".join(map(str, first["loc"]))
        shown = value if len(value) <= _SHORT else f"{value[:_SHORT]}..."
        message = str(first["msg"])
        raise ConfigError(f"{path}: {key[:_SHORT]} = {shown}: {message[0].lower()}{message[1:]}") from error
