"""The processes of a swarm that ended too early, and which of them may be started again (`swarm.py` does that, by
`Processes.restart`).
"""

from collections import Counter
from typing import Final

from fanet_mw.hosts.service import BUS_EXIT_CODE
from fanet_mw.trace import ProcessEnded

_MAX_LATE_STARTS: Final = 3
"""How often a process that has found no router may be started again before the swarm's time begins."""
_MAX_RESPAWNS: Final = 5
"""How often a process may be started again, so that one that cannot live is not started for ever."""


class Deaths:
    """The processes that died during one run."""

    def __init__(self, *, respawn: bool) -> None:
        self.ended: list[tuple[str, int]] = []
        """Name and exit code of each process that died, in order."""
        self.records: list[ProcessEnded] = []
        """The same as trace records."""
        self._respawn = respawn
        self._respawns: Counter[str] = Counter()
        self._late_starts: Counter[str] = Counter()

    def grant_late_start(self, name: str, exit_code: int) -> bool:
        """True if a process that has found no router may be started again before the swarm's time begins."""
        if exit_code != BUS_EXIT_CODE or self._late_starts[name] >= _MAX_LATE_STARTS:
            return False
        self._late_starts[name] += 1
        return True

    def note(self, name: str, exit_code: int, *, node: int, now_ns: int) -> None:
        """A process has died; `node` is its UAV, or 0 for the emulator and the world."""
        self.ended.append((name, exit_code))
        self.records.append(ProcessEnded(now_ns, node, name, exit_code))

    def grant_respawn(self, name: str) -> bool:
        """True if a process that has died may be started again."""
        self._respawns[name] += 1
        return self._respawn and self._respawns[name] <= _MAX_RESPAWNS
