"""The tidy tables of a run: one row per packet, delivery, drop, position, event, link and frame; units in the names.

A table is a generator of rows, so a run of any length is written in portions. `t_s` is swarm time.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import pyarrow as pa

from agents.applications.traffic import targets_of
from emulator.pcap_file import NAME as CAPTURE
from emulator.pcap_file import captures
from emulator.pcap_reader import frames_of
from fanet_mw.bus.link_stats import LOSSES
from fanet_mw.errors import ConfigError
from fanet_mw.trace import (
    BoundExcludes,
    BoundStated,
    Delivered,
    Dropped,
    Generated,
    LetOut,
    LikelyStated,
    Posed,
    kind_of,
)
from fanet_mw.units import MS, S
from fanet_mw.whole_file import replacing
from sim.records.record_kinds import KINDS, records_of
from sim.results.links import described
from sim.results.outcome import Outcome
from sim.results.packets import OTHER_APPS, SentPacket, packets_of

Row = tuple[Any, ...]
_APART: Final = frozenset({Generated, LetOut, BoundStated, BoundExcludes, LikelyStated, Delivered, Dropped, Posed})
"""The kinds of records that have tables of their own; all others are events."""
_PORTION: Final = 50_000


class Table(NamedTuple):
    """One table: its columns, and its rows for a run."""

    schema: pa.Schema
    rows: Callable[[Outcome, Path | None], Iterator[Row]]
    """The rows of a run, whose folder is given if it has one."""


def _schema(**columns: Any) -> pa.Schema:  # noqa: ANN401  (pyarrow has no types)
    return pa.schema(list(columns.items()))


_TEXT: Final = pa.string()
_NODE: Final = pa.uint16()


def _packets(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    sizes = {(one.node, one.seq): one.payload_bytes for one in records_of(outcome.records, Generated)}
    for app, packets in packets_of(outcome).items():
        for (origin, seq), sent in packets.sent.items():
            yield (
                sent.born_ns / S, origin, seq, app, sizes[origin, seq], sent.targets,
                None if sent.out_ns is None else sent.out_ns / S, _bound_ms(sent),
                None if sent.likely is None else sent.likely[0] / MS,
                None if sent.likely is None else sent.likely[1],
            )  # fmt: skip


def _bound_ms(sent: SentPacket | None) -> float | None:
    return None if sent is None or sent.bound_ns is None else sent.bound_ns / MS


def _deliveries(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    sent: dict[tuple[int, int], tuple[str, SentPacket]] = {
        name: (app, one) for app, packets in packets_of(outcome).items() for name, one in packets.sent.items()
    }
    classes, everyone = set(outcome.scenario.traffic_classes), frozenset(outcome.scenario.node_ids)
    meant: dict[tuple[str, int], frozenset[int]] = {}
    had: set[tuple[int, int, int]] = set()
    exact = not outcome.scenario.clock.modelled
    for one in records_of(outcome.records, Delivered):
        app, packet = sent.get((one.origin, one.seq), ("", None))
        if app in classes and (app, one.origin) not in meant:
            meant[app, one.origin] = frozenset(targets_of(outcome.scenario, one.origin, app))
        wanted = one.node in (meant[app, one.origin] if app in classes else everyone if app in OTHER_APPS else ())
        true = packet is not None and (not exact or one.t_ns - one.delay_ns == packet.born_ns)
        counts = wanted and true and one.node != one.origin and (one.node, one.origin, one.seq) not in had
        if counts:
            had.add((one.node, one.origin, one.seq))
        yield (
            one.t_ns / S, one.node, one.origin, one.seq, app, one.delay_ns / MS, one.hops, one.handover_ns / MS,
            None if packet is not None and one.node in packet.excluded else _bound_ms(packet), counts,
        )  # fmt: skip


def _drops(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    for one in records_of(outcome.records, Dropped):
        yield one.t_ns / S, one.node, one.reason, one.origin, one.seq


def _positions(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    for one in records_of(outcome.records, Posed):
        yield one.t_ns / S, *one[1:]


_EVENT_FIELDS: Final = {
    "other": _NODE, "survivor": pa.int64(), "east_m": pa.float64(), "north_m": pa.float64(), "mode": _TEXT,
    "role": _TEXT, "cluster": pa.int64(), "head": _NODE, "reporters": pa.int64(), "rssi_dbm": pa.float64(),
    "distance_m": pa.float64(), "closest_ms": pa.int64(), "label": _TEXT, "active": pa.bool_(), "name": _TEXT,
    "exit_code": pa.int64(), "place": pa.int64(), "revision": pa.int64(), "sensor": _TEXT, "fault": _TEXT,
    "seq": pa.int64(), "told": pa.bool_(), "reference": _NODE, "hops": pa.int64(),
}  # fmt: skip
"""The columns of events: the fields that a kind of event does not have are null."""
_EVENT_TIMES: Final = ("bound_ns", "deadline_ns", "interval_ns", "ahead_ns")


def _events(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    kinds = [kind for kind in KINDS if kind not in _APART]
    for one in records_of(outcome.records, *kinds):
        fields: Mapping[str, Any] = one._asdict()
        if "kind" in fields:
            fields = {**fields, "fault": fields["kind"]}
        times = (fields[name] / MS if name in fields else None for name in _EVENT_TIMES)
        yield one.t_ns / S, one.node, kind_of(one), *(fields.get(name) for name in _EVENT_FIELDS), *times


def _links(outcome: Outcome, _: Path | None) -> Iterator[Row]:
    for row in described(outcome.links.rows()):
        copies, received, lost = row["copies"], row["received"], row["lost"]
        share = received / copies if copies else None
        counts = (lost.get(reason.value, 0) for reason in LOSSES)
        yield row["src"], row["dst"], copies, received, share, row["rssi_dbm"], *counts


def _frames(outcome: Outcome, folder: Path | None) -> Iterator[Row]:
    for path in captures(folder / CAPTURE) if folder is not None else ():
        for one in frames_of(path, epoch_unix_ns=outcome.epoch_unix_ns):
            yield one.t_ns / S, *one[1:-1]


TABLES: Final[Mapping[str, Table]] = {
    "packets": Table(
        _schema(
            generated_s=pa.float64(), origin=_NODE, seq=pa.int64(), app=_TEXT, payload_bytes=pa.int32(),
            targets=_NODE, let_out_s=pa.float64(), bound_ms=pa.float64(), likely_ms=pa.float64(),
            likely_share=pa.float64(),
        ),
        _packets,
    ),
    "deliveries": Table(
        _schema(
            t_s=pa.float64(), node=_NODE, origin=_NODE, seq=pa.int64(), app=_TEXT, delay_ms=pa.float64(),
            hops=pa.int32(), handover_ms=pa.float64(), bound_ms=pa.float64(), counts=pa.bool_(),
        ),
        _deliveries,
    ),
    "drops": Table(_schema(t_s=pa.float64(), node=_NODE, reason=_TEXT, origin=_NODE, seq=pa.int64()), _drops),
    "positions": Table(
        _schema(t_s=pa.float64(), node=_NODE, east_m=pa.float64(), north_m=pa.float64(), up_m=pa.float64()),
        _positions,
    ),
    "events": Table(
        _schema(
            t_s=pa.float64(), node=_NODE, kind=_TEXT, **_EVENT_FIELDS,
            **{name.replace("_ns", "_ms"): pa.float64() for name in _EVENT_TIMES},
        ),
        _events,
    ),
    "links": Table(
        _schema(
            src=_NODE, dst=_NODE, copies=pa.int64(), received=pa.int64(), received_share=pa.float64(),
            rssi_dbm=pa.float64(), **{f"lost_{reason.value}": pa.int64() for reason in LOSSES},
        ),
        _links,
    ),
    "frames": Table(
        _schema(
            t_s=pa.float64(), what=_TEXT, src=_NODE, dst=_NODE, station=_NODE, frame_bytes=pa.int32(),
            attempt=pa.int32(), rssi_dbm=pa.int32(),
        ),
        _frames,
    ),
}  # fmt: skip
"""All tables by name. `frames` has rows only if the run was captured (`--pcap`)."""


def batches(name: str, outcome: Outcome, folder: Path | None = None) -> Iterator[pa.RecordBatch]:
    """The rows of a table in portions; at least one, which may be empty."""
    table = TABLES[name]
    rows: list[Row] = []

    def portion() -> pa.RecordBatch:
        columns = zip(*rows, strict=True) if rows else [()] * len(table.schema)
        arrays = [pa.array(column, field.type) for column, field in zip(columns, table.schema, strict=True)]
        rows.clear()
        return pa.RecordBatch.from_arrays(arrays, schema=table.schema)

    written = False
    for row in table.rows(outcome, folder):
        rows.append(row)
        if len(rows) >= _PORTION:
            written = True
            yield portion()
    if rows or not written:
        yield portion()


def table(name: str, outcome: Outcome, folder: Path | None = None) -> pa.Table:
    if name not in TABLES:
        raise ConfigError(f"table {name!r}: must be one of {', '.join(TABLES)}")
    return pa.Table.from_batches(batches(name, outcome, folder))


def write_parquet(outcome: Outcome, folder: Path | None, out: Path) -> dict[Path, int]:
    """Write each table that has rows as NAME.parquet into a folder; returns the number of rows of each."""
    import pyarrow.parquet as pq

    return _write(outcome, folder, out, ".parquet", pq.ParquetWriter)


def write_csv(outcome: Outcome, folder: Path | None, out: Path) -> dict[Path, int]:
    """Write each table that has rows as NAME.csv, with a header, into a folder; returns the number of rows of each."""
    import pyarrow.csv as csv

    return _write(outcome, folder, out, ".csv", csv.CSVWriter)


def _write(
    outcome: Outcome, folder: Path | None, out: Path, suffix: str, opened: Callable[[BinaryIO, pa.Schema], Any]
) -> dict[Path, int]:
    found: dict[Path, int] = {}
    path = out
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, described_table in TABLES.items():
            path, count = out / f"{name}{suffix}", 0
            with replacing(path) as file, opened(file, described_table.schema) as writer:
                for batch in batches(name, outcome, folder):
                    writer.write_batch(batch)
                    count += batch.num_rows
            if name == "frames" and not count:
                path.unlink()  # the run was not captured
            else:
                found[path] = count
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from error
    return found
