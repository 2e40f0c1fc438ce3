"""What befalls single UAVs at planned instants, or on command: a crash, a weak battery, a receiver that is wrong or
silent. The medium records when each begins and ends (`emulator/faults.py`).
"""

import heapq
from collections.abc import Iterable

import numpy as np

from fanet_mw.bus.radio_control import Control, Mishap, MishapKind, Restore, wrong
from fanet_mw.scenario import Scenario
from sim.world.arrays import Flags, Rows


class Mishaps:
    """The mishaps of one swarm: those to come, and the receivers that are wrong or silent now."""

    def __init__(self, scenario: Scenario) -> None:
        """A world that continues an earlier one brings about again what that one did, which changes nothing."""
        self._count = scenario.nodes.count
        self._order = 0
        self._agenda: list[tuple[int, int, Control]] = []
        self._standing: dict[str, tuple[Mishap, int]] = {}
        """Of each receiver that is wrong or silent: why, and until when; 0: until it is restored."""
        self.offset_m: Rows = np.zeros((self._count, 3))
        """By how much each GPS receiver is wrong."""
        self.silent: Flags = np.zeros(self._count, bool)
        """The GPS receivers that give no position."""
        for at_ns, control in scenario.planned_faults:
            self.add(control, at_ns)

    def add(self, control: Control, at_ns: int) -> None:
        """Something happens at this instant; what is no mishap, or impossible, is passed over."""
        if isinstance(control, Restore) or (isinstance(control, Mishap) and wrong(control, count=self._count) is None):
            heapq.heappush(self._agenda, (at_ns, self._order, control))
            self._order += 1

    def due(self, now_ns: int) -> Iterable[Mishap]:
        """The mishaps that have happened since the last call; receivers become wrong or silent, or right again."""
        ended = [label for label, (_, until_ns) in self._standing.items() if until_ns and until_ns <= now_ns]
        begun = []
        while self._agenda and self._agenda[0][0] <= now_ns:
            at_ns, _, control = heapq.heappop(self._agenda)
            if isinstance(control, Restore):
                ended += [control.label] if control.label else list(self._standing)
            elif isinstance(control, Mishap):
                if control.what in (MishapKind.GPS, MishapKind.GPS_OFF):
                    self._standing[control.label] = control, at_ns + control.for_ns if control.for_ns else 0
                    self._tell()
                begun.append(control)
        if ended:
            for label in ended:
                self._standing.pop(label, None)
            self._tell()
        return begun

    def _tell(self) -> None:
        self.offset_m[:], self.silent[:] = 0.0, False
        for mishap, _ in self._standing.values():
            if mishap.what is MishapKind.GPS:
                self.offset_m[mishap.node - 1] += mishap.value
            else:
                self.silent[mishap.node - 1] = True
