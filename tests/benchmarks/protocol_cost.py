"""What each protocol costs a node: `python tests/benchmarks/protocol_cost.py [SECONDS]`. Virtual time, 9 x 5 grid.

44 sources of 1024 B every second, to everyone, and to the leader alone for those that find routes. Per node, means:

    control   bytes on the air per second: whole frames that carry no application packet (MAC, IP and UDP headers
              included), and the routing header of each frame that does; no MAC acknowledgements and retries
    CPU       process time of all calls into the UAV over its frames, sent and heard; of this machine
    memory    everything its protocol object reaches at the end, the scenario and shared code left out
"""

import gc
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

from agents.uav import Uav
from fanet_mw import wire
from fanet_mw.airtime import OVERHEAD_BYTES
from fanet_mw.node.node import Node
from fanet_mw.node.port import NodePort
from fanet_mw.scenario import Scenario
from fanet_mw.wire import Kind
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

CASES: dict[str, tuple[str, ...]] = {
    "clustered, all": ("clusters.relay=all", "clusters.count=4", "clusters.flooding_period_s=5"),
    "clustered, counter": ("clusters.relay=counter", "clusters.count=4", "clusters.flooding_period_s=5"),
    "clustered, scheduled": (),
    **{name: (f"routing.protocol={name}",) for name in ("flooding", "gossip", "counter")},
    **{name: (f"routing.protocol={name}",) for name in ("aodv", "olsr", "dsdv", "geographic")},
    **{
        f"{name}, to the leader": (f"routing.protocol={name}", "traffic.destination=1", "traffic.sources=44")
        for name in ("aodv", "olsr", "dsdv", "geographic")
    },
}
_OWN_HELLOS = ("flooding", "gossip", "counter", "aodv", "olsr", "dsdv")
"""These need none of the node's hellos: they have their own, or none."""
_SHARED = (type, ModuleType, FunctionType, BuiltinFunctionType, Scenario)


class Spent(NamedTuple):
    """Totals of all nodes."""

    control_bytes: int
    frames: int
    cpu_ns: int


@contextmanager
def metered(control: Counter[str], nodes: list[Node]) -> Iterator[None]:
    """Count control bytes at every transmit request, and time every call into a UAV."""
    transmit, receive, wake, init = NodePort.transmit, Uav.receive, Uav.wake, Node.__init__

    def counted(port: NodePort, frame: bytes, *args: Any, **keys: Any) -> int:
        data = wire.decode_header(frame).kind == Kind.DATA
        control["bytes"] += wire.HEADER_BYTES if data else len(frame) + OVERHEAD_BYTES
        return transmit(port, frame, *args, **keys)

    def timed(call: Callable[..., None]) -> Callable[..., None]:
        def run(*args: Any) -> None:
            began = time.thread_time_ns()
            call(*args)
            control["cpu_ns"] += time.thread_time_ns() - began

        return run

    def kept(node: Node, *args: Any, **keys: Any) -> None:
        init(node, *args, **keys)
        nodes.append(node)

    with (
        patch.object(NodePort, "transmit", counted),
        patch.object(Node, "__init__", kept),
        patch.object(Uav, "receive", timed(receive)),
        patch.object(Uav, "wake", timed(wake)),
    ):
        yield


def memory_bytes(node: Node) -> int:
    """Of all that the node's protocol and its duplicate suppression reach."""
    done = {id(node), id(node.records), id(node.scenario)}
    left, total = [node._protocol, node._duplicates], 0
    while left:
        item = left.pop()
        if id(item) in done or isinstance(item, _SHARED):
            continue
        done.add(id(item))
        total += sys.getsizeof(item)
        left += gc.get_referents(item)
    return total


def measure(settings: tuple[str, ...], seconds: float) -> tuple[Spent, float, dict[str, Any]]:
    """(what was spent, mean memory of a node, the summary)."""
    keys = [f"duration_s={seconds:g}", "warmup_s=15", "drain_s=2", *settings]
    if any(f"routing.protocol={name}" in settings for name in _OWN_HELLOS):
        keys.append("routing.hello_interval_s=0")
    control: Counter[str] = Counter()
    nodes: list[Node] = []
    with metered(control, nodes):
        outcome = simulate(catalog.find("clusters", keys))
        summary = finish(outcome, out=None)
    frames = sum(node.frames_sent + node.receptions for node in nodes)
    spent = Spent(control["bytes"], frames, control["cpu_ns"])
    return spent, sum(map(memory_bytes, nodes)) / len(nodes), summary


def rows(seconds: float) -> list[list[str]]:
    """A head, and a row per protocol."""
    found = [
        ["protocol", "PDR", "control [B/s]", "frames sent + heard per second", "CPU per frame [us]", "memory [kB]"]
    ]
    for name, settings in CASES.items():
        spent, memory, summary = measure(settings, seconds)
        nodes = summary["nodes"]
        found.append(
            [
                name,
                f"{summary['pdr']:.3f}",
                f"{spent.control_bytes / nodes / seconds:.0f}",
                f"{spent.frames / nodes / seconds:.0f}",
                f"{spent.cpu_ns / spent.frames / 1000:.1f}",
                f"{memory / 1000:.0f}",
            ]
        )
    return found


def main(seconds: float) -> None:
    for cells in rows(seconds):
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60)
