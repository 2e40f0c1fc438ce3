"""Programs beside a swarm that is launched: `fanet record`, `view`, `gateway` and `autopilots`, each a process.

They are processes of their own, so that the launcher, whose router all frames pass, has nothing to do with them.
"""

import contextlib
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

from fanet_mw.errors import HostError
from fanet_mw.hosts.readiness import VARIABLE

if TYPE_CHECKING:
    from fanet_mw.hosts.realtime import SwarmAddress
    from fanet_mw.scenario import Scenario

_NICENESS: Final = 5
_ONLY_LISTEN: Final = ("record", "view")
"""These give way, because nobody depends on them; a swarm depends on its gateway and its flight controllers."""
_CLOSING_S: Final = 20.0
_TERMINATED: Final = (-signal.SIGTERM, 128 + signal.SIGTERM)


class Companions:
    """A context manager that ends what was started in it."""

    def __init__(self, commands: Sequence[Sequence[str]]) -> None:
        """`commands`: words of a command of `fanet`, without those that say which swarm is meant."""
        self._commands = commands
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._running: list[subprocess.Popen[bytes]] = []
        self._unready: dict[int, int] = {}
        """The reading end of the pipe of each that has not said yet that it listens, by the index of its command."""
        self.failed: dict[str, str] = {}
        """How each ended that did not end in good order, by its first word; known when all were ended."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, address: "SwarmAddress", scenario: "Scenario") -> None:
        """Start all of them for a swarm that comes up. A scenario that names files is handed over as a file."""
        for words in self._commands:
            where = ["--connect", address.endpoint, "--swarm", address.swarm]
            if address.zenoh_config is not None:
                where += ["--zenoh-config", str(address.zenoh_config)]
            if scenario.world.heightmap or scenario.world.buildings_geojson:
                where += ["--scenario", str(self._written(scenario))]
            # -P: a file where the launcher was called, say attrs.py, is no module; they find what this process finds
            command = [sys.executable, "-P", "-m", "fanet_mw", *words, *where]
            found = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
            hears, tells = os.pipe()
            self._unready[len(self._running)] = hears
            self._running.append(
                subprocess.Popen(  # noqa: S603  (a command of fanet-mw)
                    command, env={**found, VARIABLE: str(tells)}, pass_fds=(tells,), process_group=0,
                    stdin=subprocess.DEVNULL, preexec_fn=partial(_begin, gives_way=words[0] in _ONLY_LISTEN),
                )
            )  # fmt: skip
            os.close(tells)

    def awaited(self) -> list[str]:
        """Those that do not listen yet, for which the swarm waits; raises HostError if one fails before that."""
        for index, pipe in [*self._unready.items()]:
            if not select.select([pipe], [], [], 0)[0]:
                continue
            listens = os.read(pipe, 1)
            os.close(self._unready.pop(index))
            if not listens and (code := self._running[index].wait()):
                words = " ".join(self._commands[index])
                raise HostError(f"fanet {words}: ended with code {code}, so nobody takes off")
        return [f"fanet {self._commands[index][0]}" for index in self._unready]

    def end(self) -> None:
        """End them; a recording closes its file first."""
        from sim.results.outcome import described

        for process in self._running:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
        for words, process in zip(self._commands, self._running, strict=False):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_CLOSING_S)
            process.kill()
            code = process.wait()
            if code and (words[0] == "record" or code not in _TERMINATED):  # a recording must end by itself
                self.failed[words[0]] = described(code)
        self._running.clear()
        for pipe in self._unready.values():
            os.close(pipe)
        self._unready.clear()
        if self._folder is not None:
            self._folder.cleanup()

    def _written(self, scenario: "Scenario") -> Path:
        import tomli_w

        self._folder = self._folder or tempfile.TemporaryDirectory(prefix="fanet-")
        path = Path(self._folder.name) / "scenario.toml"
        path.write_text(tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
        return path


def _begin(*, gives_way: bool) -> None:
    """A companion is in a group of its own, which Ctrl-C does not reach, but in the launcher's session: Linux may share
    processors among sessions before it looks at niceness, and one of its own would take as much as a swarm, or starve.
    """
    if gives_way:
        os.nice(_NICENESS)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # with `stty tostop` its first words would stop it
