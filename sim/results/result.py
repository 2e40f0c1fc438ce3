"""What a run gives to a program: its summary, its trace in columns, its deliveries."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from fanet_mw.trace import Delivered, kind_of
from sim.results.files import finish
from sim.results.outcome import Outcome


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
