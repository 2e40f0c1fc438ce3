"""Leaves out what an emulator that was started again tells anew of the faults planned in its scenario."""

from collections.abc import Iterable
from typing import Final

from fanet_mw.trace import RadioFault, Record

_MOST: Final = 4096
"""Of faults that are remembered; a foreign program may tell of any number."""


class ToldFaults:
    """The faults told so far. A planned fault begins and ends at the same instant in each life of an emulator, so what
    is equal is told anew.
    """

    def __init__(self) -> None:
        self._told: set[RadioFault] = set()

    def fresh(self, records: Iterable[Record]) -> list[Record]:
        return [record for record in records if not isinstance(record, RadioFault) or self._is_fresh(record)]

    def _is_fresh(self, fault: RadioFault) -> bool:
        if fault in self._told:
            return False
        if len(self._told) < _MOST:
            self._told.add(fault)
        return True
