"""What a run gives to a program, as it ended or from its folder: its summary, its trace in columns, its deliveries."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from fanet_mw.bus.link_stats import LOSSES, LinkRow
from fanet_mw.trace import Delivered, Record, kind_of
from fanet_mw.units import US, NodeId, S
from sim.records.record_kinds import StoredTrace
from sim.records.spool import OnDisk
from sim.results.files import finish
from sim.results.links import LinkTotals
from sim.results.outcome import Outcome
from sim.results.run_folder import RunFolder


class Result:
    """One finished run, as programs and notebooks read it."""

    def __init__(self, outcome: Outcome, *, summary: Mapping[str, Any] | None = None) -> None:
        """`summary`: of a run whose files were read; otherwise it is made when it is asked for."""
        self.outcome = outcome
        """The run as the functions of `sim.results` read it; its shape is no part of the promise."""
        self._summary = summary

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """The content of `summary.json`."""
        return finish(self.outcome, out=None) if self._summary is None else self._summary

    @cached_property
    def trace(self) -> Mapping[str, Mapping[str, Sequence[Any]]]:
        """The fields of each kind of record as columns of one length: `trace["delivered"]["delay_ns"]`."""
        columns: dict[str, dict[str, list[Any]]] = {}
        for record in self.outcome.records:
            fields = columns.setdefault(kind_of(record), {name: [] for name in record._fields})
            for name, value in zip(record._fields, record, strict=True):
                fields[name].append(value)
        return columns

    @cached_property
    def deliveries(self) -> Sequence[Delivered]:
        """Every packet that was handed to the applications of a node it was meant for."""
        return [record for record in self.outcome.records if type(record) is Delivered]

    @property
    def reports(self) -> Mapping[str, Mapping[str, Any]]:
        """The counters of each actor, by its name (`agent-3`, `emulator`, `world`)."""
        return self.outcome.reports

    def __repr__(self) -> str:
        summary = self.summary
        return (
            f"<Result of {summary['scenario']}, seed {summary['seed']}: {summary['simulated_s']} s, "
            f"pdr {summary['pdr']}, {len(self.outcome.records)} records>"
        )


class FolderRecords(StoredTrace):
    """The trace of a folder; each iteration reads the file again."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder

    @cached_property
    def _count(self) -> int:
        return super().__len__()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Record]:
        return self._folder.records()

    def of_kinds(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        return self._folder.records(*kinds)


class _FolderTaps(OnDisk[tuple[int, bytes]]):
    """The taps of a folder, frame by frame, at instants of whole microseconds."""

    def __init__(self, folder: RunFolder, *, epoch_unix_ns: int) -> None:
        self._folder = folder
        self._epoch_ns = epoch_unix_ns

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        return ((t_us * US - self._epoch_ns, frame) for t_us, frame in self._folder.telemetry())


def load_result(folder: Path | str) -> Result:
    """What `simulate` or `launch` returned for the run that this folder holds; raises ConfigError.

    The trace is read when it is asked for, and checked against the digest that the summary names.
    """
    found = RunFolder(Path(folder))
    return Result(_outcome(found), summary=found.summary)


def _outcome(folder: RunFolder) -> Outcome:
    summary = folder.summary
    simulated_ns = round(summary["simulated_s"] * S)
    epoch_ns = summary.get("epoch_unix_ns", 0)
    return Outcome(
        scenario=folder.scenario,
        mode=summary["mode"],
        wall_s=summary.get("wall_s", 0.0),
        records=FolderRecords(folder),
        reports=folder.reports(),
        taps=_FolderTaps(folder, epoch_unix_ns=epoch_ns),
        links=_totals(folder),
        aborted=summary.get("aborted"),
        ended_ns=None if summary.get("aborted") is None else simulated_ns,
        epoch_unix_ns=epoch_ns,
    )


def _totals(folder: RunFolder) -> LinkTotals:
    """The links of a run; their mean RSSI has the digits of the file."""
    rows = []
    for link in folder.links():
        lost: Mapping[str, int] = link.get("lost", {})
        rssi_dbm: Any = link.get("rssi_dbm")
        total_mdbm = 0 if rssi_dbm is None else round(rssi_dbm * 1000 * link["received"])
        counts = tuple(int(lost.get(reason.value, 0)) for reason in LOSSES)
        rows.append(LinkRow(NodeId(link["src"]), NodeId(link["dst"]), link["received"], counts, total_mdbm))
    return LinkTotals.of(rows)
