"""`fanet air`: changes the air of a running swarm, and confirms that the emulator has made the change.

A change is one message on `fanet/<swarm>/radio/control`. The emulator's trace shows that it was made. Silence means
that it was refused (the emulator's report counts why), or that no emulator serves that swarm.
"""

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TraceBatch
from fanet_mw.bus.radio_control import Control, Restore, nodes_of
from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.errors import FanetError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.scenario.fingerprint import told_by
from fanet_mw.trace import RadioFault

OPERATOR: Final = "operator"
"""The name that access lists give to an operator's commands."""
CONFIRM_TIMEOUT_S: Final = 5.0
"""How long a confirmation is waited for; emulators publish their trace twice a second."""
_DISCOVER_S: Final = 1.0


def find_swarm(bus: Bus) -> str:
    """The swarm on this router whose emulator runs; raises FanetError unless there is exactly one."""
    found: list[str] = []
    came = threading.Event()

    def on_change(topic: str, alive: bool) -> None:
        if alive:
            found.append(topic.split("/")[1])
            came.set()

    bus.watch(f"{ROOT}/*/alive/emulator/**", on_change)
    if came.wait(_DISCOVER_S):
        time.sleep(0.1)  # other emulators may answer too
    names = sorted(set(found))
    if not names:
        raise FanetError("no emulator of a swarm runs on this router; one that was just started needs some seconds")
    if len(names) > 1:
        raise FanetError(f"{len(names)} swarms with an emulator on this router ({', '.join(names)}): say --swarm NAME")
    return names[0]


def change(endpoint: str, swarm: str | None, control: Control, *, zenoh_config: Path | None = None) -> list[RadioFault]:
    """Send one change; returns what the emulator has done. Raises BusError without a router, else FanetError."""
    with Bus.join(endpoint, config_of(zenoh_config, OPERATOR)) as bus:
        names = Topics(swarm or find_swarm(bus))
        count = scenario_of_swarm(bus, names).get("nodes", {}).get("count")
        unknown = (
            []
            if not isinstance(count, int) or isinstance(control, Restore)
            else [n for n in nodes_of(control) if n > count]
        )
        if unknown:
            raise FanetError(f"node {unknown[0]}: the nodes of swarm {names.swarm} are 1 to {count}")
        done: list[RadioFault] = []
        confirmed = threading.Event()
        bus.subscribe(names.trace("emulator"), _watch(control, done, confirmed))
        bus.put(names.radio_control, codecs.encode([control]), reliable=True)
        if not confirmed.wait(CONFIRM_TIMEOUT_S):
            raise FanetError(
                f"the emulator did not confirm within {CONFIRM_TIMEOUT_S:g} s: refused (see `refused` in its report), "
                f"or no emulator on {names.radio_control}"
            )
        return list(done)


def scenario_of_swarm(bus: Bus, names: Topics) -> Mapping[str, Any]:
    """The scenario of a swarm as tables, by the keeper of its clock; empty if nobody says it at once."""
    answers: list[bytes] = []
    came = threading.Event()

    def on_answer(_topic: str, payload: bytes) -> None:
        answers.append(payload)
        came.set()

    bus.ask(names.scenario, on_answer)
    came.wait(_DISCOVER_S)
    try:
        tree = told_by(names.swarm, answers[0]) if answers else {}
    except (ValueError, RecursionError):
        return {}
    return {name: table for name, table in tree.items() if isinstance(table, dict)}


def _watch(control: Control, done: list[RadioFault], confirmed: threading.Event) -> Callable[[str, bytes], None]:
    """A handler that collects the faults with the control's label from the trace; all faults if the label is empty."""

    def on_sample(_topic: str, payload: bytes) -> None:
        try:
            batches = [message for message in codecs.decode(payload) if isinstance(message, TraceBatch)]
        except MalformedFrameError:
            return
        faults = [record for batch in batches for record in batch.records if isinstance(record, RadioFault)]
        done.extend(fault for fault in faults if control.label in ("", fault.label))
        if done:
            confirmed.set()

    return on_sample
