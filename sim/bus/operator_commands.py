"""`fanet air` and `fanet order`: one message, and the wait until the trace of who obeys shows that it was done.

Silence means that it was refused (the report of the emulator or the post counts why), or that nobody is there.
"""

import queue
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Message, TraceBatch
from fanet_mw.bus.radio_control import Control, Mishap, MishapKind, Restore, nodes_of
from fanet_mw.bus.topics import ROOT, Topics
from fanet_mw.errors import FanetError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.orders import Order
from fanet_mw.scenario.fingerprint import told_by
from fanet_mw.trace import Ordered, RadioFault, Record

OPERATOR: Final = "operator"
"""The name that access lists give to an operator's commands."""
CONFIRM_TIMEOUT_S: Final = 5.0
"""How long a confirmation is waited for; emulators publish their trace twice a second."""
_DISCOVER_S: Final = 1.0


def find_swarm(bus: Bus) -> str:
    """The swarm on this router whose emulator runs; raises FanetError unless there is exactly one."""
    found: queue.SimpleQueue[str] = queue.SimpleQueue()

    def on_change(topic: str, alive: bool) -> None:
        if alive:
            found.put(topic.split("/")[1])

    bus.watch(f"{ROOT}/*/alive/emulator/**", on_change)
    try:
        names = {found.get(timeout=_DISCOVER_S)}
    except queue.Empty:
        raise FanetError(
            "no emulator of a swarm runs on this router; one that was just started needs some seconds"
        ) from None
    time.sleep(0.1)  # other emulators may answer too
    while not found.empty():
        names.add(found.get())
    if len(names) > 1:
        raise FanetError(
            f"{len(names)} swarms with an emulator on this router ({', '.join(sorted(names))}): say --swarm NAME"
        )
    return names.pop()


def change(endpoint: str, swarm: str | None, control: Control, *, zenoh_config: Path | None = None) -> list[RadioFault]:
    """Send one change; returns what the emulator has done. Raises BusError without a router, else FanetError."""
    with Bus.join(endpoint, config_of(zenoh_config, OPERATOR)) as bus:
        names = Topics(swarm or find_swarm(bus))
        if (why := impossible(control, scenario_of_swarm(bus, names), names.swarm)) is not None:
            raise FanetError(why)

        def confirms(record: Record) -> bool:
            return isinstance(record, RadioFault) and control.label in ("", record.label)

        done = put_and_watch(bus, names.radio_control, control, names.trace("emulator"), confirms)
        if not done:
            raise FanetError(
                f"the emulator did not confirm within {CONFIRM_TIMEOUT_S:g} s: {_refused(control)}, or no emulator on "
                f"{names.radio_control}"
            )
        return [record for record in done if isinstance(record, RadioFault)]


def _refused(control: Control) -> str:
    """Why an emulator that is there has recorded nothing of a change."""
    if not isinstance(control, Restore):
        return "refused (see `refused` in its report)"
    which = f"has the label {control.label!r}" if control.label else "is in force"
    return f"no fault that can end {which}"


def impossible(control: Control, tree: Mapping[str, Any], swarm: str) -> str | None:
    """Why a change has no effect in a swarm with this scenario; None if it has one, or the scenario is not known. The
    rules are those for the faults in a scenario's file.
    """
    count = tree.get("nodes", {}).get("count")
    if not isinstance(count, int) or isinstance(control, Restore):
        return None
    befalls = isinstance(control, Mishap)
    most = count + (bool(tree.get("ground", {}).get("at_m")) and not befalls)
    for node in nodes_of(control):
        if node > most:
            return f"node {node}: the {'UAVs' if befalls else 'nodes'} of swarm {swarm} are 1 to {most}"
    drains = tree.get("sensors", {}).get("battery_hz") or tree.get("world", {}).get("engine") == "rotors"
    if isinstance(control, Mishap) and control.what is MishapKind.BATTERY and not drains:
        return f"battery: swarm {swarm} has none: its scenario has sensors.battery_hz = 0"
    return None


def put_and_watch(
    bus: Bus, topic: str, message: Message, trace: str, confirms: Callable[[Record], bool]
) -> list[Record]:
    """Put a message; returns the first records of a trace that confirm it, none if none come in time."""
    parts: queue.SimpleQueue[list[Record]] = queue.SimpleQueue()

    def on_trace(_topic: str, payload: bytes) -> None:
        try:
            batches = [message for message in codecs.decode(payload) if isinstance(message, TraceBatch)]
        except MalformedFrameError:
            return
        if found := [record for batch in batches for record in batch.records if confirms(record)]:
            parts.put(found)

    bus.subscribe(trace, on_trace)
    bus.put(topic, codecs.encode([message]), reliable=True)
    try:
        return parts.get(timeout=CONFIRM_TIMEOUT_S)
    except queue.Empty:
        return []


def scenario_of_swarm(bus: Bus, names: Topics) -> Mapping[str, Any]:
    """The scenario of a swarm as tables, by the keeper of its clock; empty if nobody says it at once."""
    try:
        tree = told_by(names.swarm, first_answer(bus, names.scenario, timeout_s=_DISCOVER_S) or b"{}")
    except (ValueError, RecursionError):
        return {}
    return {name: table for name, table in tree.items() if isinstance(table, dict)}


def first_answer(bus: Bus, topic: str, *, timeout_s: float) -> bytes | None:
    answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    bus.ask(topic, lambda _topic, payload: answers.put(payload))
    try:
        return answers.get(timeout=timeout_s)
    except queue.Empty:
        return None


_ALL: Final = "*"


def give(endpoint: str, swarm: str | None, order: Order, *, zenoh_config: Path | None = None) -> Ordered:
    """Give an order; returns what the post has recorded of it. Raises BusError without a router, else FanetError."""
    with Bus.join(endpoint, config_of(zenoh_config, OPERATOR)) as bus:
        names = Topics(swarm or find_swarm(bus))
        tree = scenario_of_swarm(bus, names)
        count = tree.get("nodes", {}).get("count")
        if tree and not tree.get("ground", {}).get("at_m"):
            raise FanetError(f"swarm {names.swarm} has no post on the ground: its scenario has no ground.at_m")
        if isinstance(count, int) and order.node > count:
            raise FanetError(f"node {order.node}: the UAVs of swarm {names.swarm} are 1 to {count}")

        def confirms(record: Record) -> bool:
            return (
                isinstance(record, Ordered)
                and record.order == order.kind.name.lower()
                and order.node in (0, record.other)
            )

        trace = names.trace(_ALL if not isinstance(count, int) else f"agent-{count + 1}")
        for record in put_and_watch(bus, names.orders, order, trace, confirms):
            if isinstance(record, Ordered):
                return record
        raise FanetError(
            f"the post did not give the order within {CONFIRM_TIMEOUT_S:g} s: refused (`orders_refused` in its "
            f"report: no UAV that takes part has been heard), or no post on {names.orders}"
        )
