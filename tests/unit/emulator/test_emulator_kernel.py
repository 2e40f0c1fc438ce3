"""Laws of the emulated air that hold whatever is sent: books close, and waking more often changes nothing."""

import hashlib
import math
import os
import subprocess
import sys
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples

from emulator.channel.error_rate import log_success_per_bit
from emulator.channel.propagation import neighbors
from emulator.kernel import jit, state
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB
from emulator.medium import Medium
from fanet_mw.bus.messages import Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics
from fanet_mw.rng import stream
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, MS, US, NodeId

NAMES = Topics("k")
Output = tuple[str, Any]


def medium(count: int, **radio: Any) -> Medium:
    tree = {"nodes": {"count": count}, "routing": {"protocol": "direct"}, "radio": radio}
    air = Medium(config.build(tree), "k")
    air.start(0)
    return air


def place(air: Medium, places: list[tuple[float, float]], t_ns: int) -> None:
    states = array("d", [value for east, north in places for value in (east, north, 50.0, 0.0, 0.0, 0.0)])
    air.receive(NAMES.pose, Poses(t_ns, array("H", range(1, len(places) + 1)), states), t_ns)


def run(air: Medium, seed: int, *, count: int, frames: int, extra_wakes: int = 0) -> list[Output]:
    """Random requests of stations that jump around every 5 ms, then silence; `extra_wakes` nobody asked for."""
    rng = stream(seed, "load")
    span_ns = frames * 300 * US
    events: list[tuple[int, int, Any]] = []
    for _ in range(frames):
        dst = BROADCAST if rng.random() < 0.5 else NodeId(rng.randint(1, count))
        size = rng.choice([20, 300, 1024])
        events.append((round(rng.random() * span_ns), 1, (rng.randint(1, count), size, dst)))
    instants_ns = range(0, span_ns, 5 * MS)
    events += [(t_ns, 0, [(rng.random() * 600, rng.random() * 600) for _ in range(count)]) for t_ns in instants_ns]
    shaker = stream(seed, "shake")
    events += [(round(shaker.random() * 2 * span_ns), 2, None) for _ in range(extra_wakes)]
    outputs: list[Output] = []
    seq = [0] * (count + 1)
    for t_ns, kind, what in sorted(events, key=lambda event: event[:2]):
        drain(air, outputs, until_ns=t_ns - 1)
        if kind == 0:
            place(air, what, t_ns)
            assert_copies_add_up(air)
        elif kind == 1:
            src, size, dst = what
            air.receive(NAMES.radio_tx(src), TxRequest(seq[src], t_ns, bytes(size), dst, wants_status=True), t_ns)
            seq[src] += 1
        else:
            air.wake(t_ns)
        outputs += told(air)
    drain(air, outputs, until_ns=10**12)
    air.stop(10**12)
    assert not told(air), "all was told before"
    return outputs


def assert_copies_add_up(air: Medium) -> None:
    """Every copy is received, lost for one reason, or still on the air: also while stations jump around."""
    copies = air.report()["copies"]
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values()) + copies["in_flight"]


def told(air: Medium) -> list[Output]:
    """What nodes were told; the state of links is for others."""
    found = [(topic, message) for topic, message in air.outbox if topic != NAMES.radio_links]
    air.outbox.clear()
    return found


def drain(air: Medium, outputs: list[Output], *, until_ns: int) -> None:
    while (wake_ns := air.next_wake_ns()) is not None and wake_ns <= until_ns:
        air.wake(wake_ns)
        found = told(air)
        for _, message in found:
            early_ns = wake_ns - message.end_ns
            assert early_ns >= 0, "nothing is told before it happened"
            if isinstance(message, Reception):
                assert early_ns < 6 * US, "a reception is told when its frame has ended at its last receiver"
        outputs += found


LOADS = st.tuples(
    st.integers(0, 10_000), st.integers(2, 12), st.sampled_from(["range", "log_distance"]),
    st.sampled_from(["standard", "ns3"]),
)  # fmt: skip


@examples(60)
@given(LOADS)
@example((3830, 9, "range", "ns3"))  # a remaining backoff shorter than the DIFS that a fresh frame waits
@example((191, 3, "log_distance", "standard"))  # the last frame ends at a station that cannot hear it
@example((212, 11, "log_distance", "ns3"))  # the air falls silent where a frame ends that nobody could hear alone
def test_all_books_close_and_the_air_falls_silent(load: tuple[int, int, str, str]) -> None:
    seed, count, channel, access = load
    air = medium(count, channel=channel, access=access, queue_frames=6, lifetime_ms=40)
    outputs = run(air, seed, count=count, frames=150)
    report = air.report()
    frames, copies = report["frames"], report["copies"]
    assert frames["sent"] == 150
    assert frames["in_flight"] == 0
    assert frames["delivered"] + sum(frames["dropped"].values()) == 150
    assert copies["in_flight"] == 0
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values())
    assert sum(report["handed"].values()) == sum(isinstance(message, Reception) for _, message in outputs)
    assert sum(isinstance(message, TxStatus) for _, message in outputs) == 150
    rows = air._kernel.arrays.st
    for row in (state.CS, state.NSIG, state.QLEN, state.TX_KIND):
        assert not rows[row].any(), "the air is silent"
    for row in (state.LOCK, state.WAITING, state.HEAD, state.ACK_TO, state.BUSY_SINCE):
        assert (rows[row] == -1).all(), "nobody waits for anything"


@examples(8)
@given(LOADS)
def test_waking_more_often_than_asked_changes_nothing(load: tuple[int, int, str, str]) -> None:
    seed, count, channel, access = load

    def outputs(extra_wakes: int) -> list[Output]:
        found = run(
            medium(count, channel=channel, access=access), seed, count=count, frames=80, extra_wakes=extra_wakes
        )
        return sorted(found, key=lambda output: (output[1].end_ns, output[0], isinstance(output[1], Reception)))

    assert outputs(0) == outputs(200)


def test_the_same_source_uncompiled_gives_the_same_air() -> None:
    if not jit.COMPILED:
        pytest.skip("numba is not installed")
    program = (
        "import sys; sys.path[:0] = sys.argv[1:]\n"
        "import test_emulator_kernel as t\n"
        "print(t.fingerprint(), t.jit.COMPILED)"
    )
    environment = {**os.environ, "FANET_NO_NUMBA": "1"}
    command = [sys.executable, "-c", program, str(Path(__file__).parent), str(Path(__file__).parents[2])]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == [fingerprint(), "False"]


def fingerprint() -> str:
    """Everything that came out of one run of each kind of channel, in short."""
    digest = hashlib.sha256()
    faded = {"channel": "two_ray", "shadowing_db": 5.0, "fading": "nakagami", "capture": True, "standard": "g"}
    for radio in ({"channel": "range"}, {"channel": "log_distance"}, faded):
        for output in run(medium(8, **radio), 5, count=8, frames=120):
            digest.update(repr(output).encode())
    return digest.hexdigest()


def test_a_change_in_any_compiled_source_changes_where_its_machine_code_is_kept(tmp_path: Path) -> None:
    for name, source in (
        ("frame_exchange.py", "from emulator.kernel.jit import jit\n"),
        ("state.py", "A = 1\n"),
        ("medium.py", "\n"),
    ):
        (tmp_path / name).write_text(source)
    before = jit._fingerprint(tmp_path)
    (tmp_path / "medium.py").write_text("# not compiled\n")
    assert jit._fingerprint(tmp_path) == before
    (tmp_path / "frame_exchange.py").write_text("from emulator.kernel.jit import jit\n# changed\n")
    assert jit._fingerprint(tmp_path) != before


@examples(20)
@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(10, 2000))
def test_neighbors_are_all_pairs_within_reach_in_order_of_ids(seed: int, count: int, reach: float) -> None:
    rng = stream(seed, "places")
    at = np.array([[rng.uniform(-3000, 3000), rng.uniform(-500, 500), rng.uniform(0, 100)] for _ in range(count)])
    at[rng.randrange(count)] = np.inf
    found, distance = neighbors(at, reach)
    expected = [
        (a, b)
        for a in range(count)
        for b in range(count)
        if a != b and np.isfinite(at[[a, b]]).all() and math.dist(at[a], at[b]) <= reach
    ]
    assert [tuple(pair) for pair in found.tolist()] == expected
    assert distance.tolist() == pytest.approx([math.dist(at[a], at[b]) for a, b in expected])


def completion(rate_mbps: float, sinr_db: float) -> float:
    """Share of frames of 128 bytes that come through."""
    at = round((sinr_db - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB)
    return math.exp(8 * 128 * log_success_per_bit(rate_mbps)[at])


@pytest.mark.parametrize(
    ("rate_mbps", "half_db"), [(11.0, 4.1), (5.5, 1.1), (2.0, -3.3), (1.0, -6.3)]
)  # where EMANE's 802.11abg curves, an independent model, pass one half
def test_error_rates_cross_one_half_near_those_of_another_model(rate_mbps: float, half_db: float) -> None:
    assert completion(rate_mbps, half_db - 2.5) < 0.5 < completion(rate_mbps, half_db + 2.5)


@pytest.mark.parametrize("rate_mbps", [1.0, 2.0, 5.5, 11.0])
def test_more_sinr_never_hurts_and_enough_is_enough(rate_mbps: float) -> None:
    success = log_success_per_bit(rate_mbps)
    assert (np.diff(success) >= -1e-12).all()
    assert success[-1] > -1e-9
    assert success[0] < -1e-3


def test_a_slow_ack_that_outlasts_the_timeout_still_counts() -> None:
    """At 1 Mb/s an ACK takes 304 us; the timeout is 222 us, but its header is there by then."""
    air = medium(2, ack_rate_mbps=1.0)
    place(air, [(0, 0), (150, 0)], 0)
    air.receive(NAMES.radio_tx(1), TxRequest(0, MS, bytes(1024), NodeId(2), wants_status=True), 0)
    outputs: list[Output] = []
    drain(air, outputs, until_ns=100 * MS)
    (status,) = [message for _, message in outputs if isinstance(message, TxStatus)]
    assert status == TxStatus(0, TxOutcome.ACKED, MS + (984 + 10 + 304) * US + 2 * 500, 1)


def test_a_full_queue_expires_what_waits_and_not_what_is_on_the_air() -> None:
    air = medium(2, queue_frames=3, lifetime_ms=1)
    place(air, [(0, 0), (150, 0)], 0)
    for seq, start_ns in enumerate((0, 0, 0, 1_500 * US)):  # at 1.5 ms the second frame is on the air, 1.5 ms old
        air.receive(NAMES.radio_tx(1), TxRequest(seq, start_ns, bytes(1024), BROADCAST, wants_status=True), 0)
    outputs: list[Output] = []
    drain(air, outputs, until_ns=100 * MS)
    ended = {message.seq: message.outcome for _, message in outputs if isinstance(message, TxStatus)}
    assert ended[0] is TxOutcome.SENT
    assert sorted(ended) == [0, 1, 2, 3]
    assert air.report()["frames"]["in_flight"] == 0


def test_more_requests_of_one_instant_than_the_kernel_is_told_of_at_a_time_all_count() -> None:
    count, each = 45, 20
    air = medium(count, channel="range")
    place(air, [(10.0 * node, 0.0) for node in range(count)], 0)
    for node in range(1, count + 1):
        for seq in range(each):
            air.receive(NAMES.radio_tx(node), TxRequest(seq, 2000 * MS, bytes(100), BROADCAST, wants_status=True), 0)
    outputs: list[Output] = []
    drain(air, outputs, until_ns=5000 * MS)
    ends = [message for _, message in outputs if isinstance(message, TxStatus)]
    frames = air.report()["frames"]
    assert frames["sent"] == len(ends) == count * each
    assert frames["delivered"] + sum(frames["dropped"].values()) == count * each
