"""Compile the kernel, once: `python -m emulator.compile`. numba keeps the result in its cache."""

from array import array
from collections.abc import Mapping

from emulator.jit import COMPILED
from emulator.medium import Medium
from fanet_mw import config
from fanet_mw.messages import Poses, TxRequest
from fanet_mw.topics import Topics
from fanet_mw.units import BROADCAST, MS, NodeId


def warm_up() -> bool:
    """Run every compiled function once, the optional ones too; returns whether they are machine code."""
    _run({})
    _run({"channel": "friis", "shadowing_db": 1.0, "fading": "rician", "capture": True})
    return COMPILED


def _run(radio: Mapping[str, object]) -> None:
    """Two stations, a few frames, poses in the middle of one."""
    scenario = config.build({"nodes": {"count": 2}, "clusters": {"count": 1}, "radio": radio})
    topics = Topics("warm-up")
    medium = Medium(scenario, "warm-up")
    medium.start(0)

    def poses(t_ns: int, east: float) -> Poses:
        return Poses(t_ns, array("H", [1, 2]), array("d", [0.0] * 6 + [east] + [0.0] * 5))

    medium.receive(topics.pose, poses(0, 100.0), 0)
    medium.receive(topics.radio_tx(1), TxRequest(0, 0, b"x", BROADCAST, wants_status=False), 0)
    medium.receive(topics.radio_tx(1), TxRequest(1, 0, b"x" * 500, NodeId(2), wants_status=True), 0)
    medium.receive(topics.pose, poses(MS, 120.0), MS)
    medium.next_wake_ns()
    medium.stop(20 * MS)


if __name__ == "__main__":
    warm_up()
