"""What the emulator's channel model says before take-off: the quality of each link, and the chance of single frames.

    mean power (path loss; shadowing of another seed than the run's) -> gains of fading -> mean success of a frame

The frames are those of the application. For the quality no other node transmits, and there are no obstacles.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Final

from fanet_mw.airtime import OVERHEAD_BYTES, Timing
from fanet_mw.graph.topology import within_range
from fanet_mw.rng import stream, stream_seed
from fanet_mw.routing.clustered.links.link_quality import STEADY
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.links import Link, grade_of, power_of
from sim.planner.flood_loss import Chance

if TYPE_CHECKING:
    from emulator.channel.error_rate import Reals

_GAINS: Final = 400
_LEAST: Final = 0.02
"""Links with a smaller share are received too rarely to be known."""


def expected_links(scenario: Scenario, at: Mapping[NodeId, Enu], *, draw: int) -> tuple[Link, ...]:
    """One entry per pair of nodes that receive each other; `draw` is the number of the draw of shadowing."""
    import numpy as np

    from emulator.channel.link_budget import noise_mw, received_dbm
    from emulator.channel.shadowing import Shadowing
    from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB

    radio, nodes = scenario.radio, sorted(at)
    places = np.array([tuple(at[node]) for node in nodes], dtype=np.float64)
    pairs = np.argwhere(np.triu(np.ones((len(nodes), len(nodes)), dtype=bool), 1)).astype(np.int64)
    ends = places[pairs[:, 0]], places[pairs[:, 1]]
    distance = np.linalg.norm(ends[0] - ends[1], axis=1)
    gains_dbi = np.array([_gain_dbi(scenario, nodes[a], nodes[b]) for a, b in pairs.tolist()])
    mean_dbm = received_dbm(distance, *ends, radio) + gains_dbi
    if radio.shadowing_db:
        field = Shadowing(radio, seed=stream_seed(draw, "plan"))
        mean_dbm = mean_dbm - field.loss_db(places, pairs, distance)
    if radio.channel == "range":
        success = (distance <= radio.range_m * np.power(10.0, gains_dbi / 20)).astype(np.float64)
    else:
        power_dbm = mean_dbm[:, None] + 10 * np.log10(np.array(_gains(radio)))[None, :]
        snr_db = power_dbm - 10 * math.log10(noise_mw(radio))
        logs = sum(
            bits * table[np.clip(((snr_db - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB).astype(int), 0, len(table) - 1)]
            for bits, table in _parts_of_frame(scenario)
        )
        heard = (power_dbm >= radio.sensitivity_dbm) & (snr_db >= radio.preamble_snr_db)
        success = np.where(heard, np.exp(logs), 0.0).mean(axis=1)
    return tuple(
        Link(nodes[a], nodes[b], grade_of(min(STEADY, float(share))), power_of(float(dbm)))
        for (a, b), share, dbm in zip(pairs.tolist(), success, mean_dbm, strict=True)
        if share >= _LEAST
    )


def _parts_of_frame(scenario: Scenario) -> "tuple[tuple[float, Reals], ...]":
    """The bits of a frame's header and of its rest, each with ln(1 - bit error rate) by SINR as in the emulator."""
    from emulator.channel.error_rate import SHORT_BYTES, header_rates, log_success_per_bit

    radio, frame_bytes = scenario.radio, scenario.traffic.payload_bytes + OVERHEAD_BYTES
    header_rate, bits_per_ns = header_rates(radio.rate_mbps)
    return (
        (Timing.of(radio).header_ns * bits_per_ns, log_success_per_bit(header_rate, radio.ofdm_errors, short=True)),
        (8 * frame_bytes, log_success_per_bit(radio.rate_mbps, radio.ofdm_errors, short=frame_bytes < SHORT_BYTES)),
    )


def _gains(radio: Radio) -> list[float]:
    """Power gains of the scenario's fading, by `emulator/channel/fading.py`."""
    random = stream(0, "plan", 0)
    if radio.fading == "nakagami":
        return [max(1e-12, random.gammavariate(radio.nakagami_m, 1 / radio.nakagami_m)) for _ in range(_GAINS)]
    if radio.fading == "rician":
        k = math.pow(10.0, radio.rician_k_db / 10)
        direct, sigma = math.sqrt(k / (k + 1)), math.sqrt(0.5 / (k + 1))
        return [(direct + random.gauss(0.0, sigma)) ** 2 + random.gauss(0.0, sigma) ** 2 + 1e-12 for _ in range(_GAINS)]
    return [1.0]


def chance_of(scenario: Scenario, at: Mapping[NodeId, Enu]) -> Chance | None:
    """The `Chance` of the application's frames; interference lasts for the whole frame, the worst case. None with
    obstacles, with shadowing, whose losses are not independent from frame to frame, and with fading.
    """
    radio = scenario.radio
    if radio.fading != "none" or radio.shadowing_db > 0 or scenario.world.has_obstacles:
        return None
    if radio.channel == "range":
        return _by_range(scenario, at)
    return _by_error_rate(scenario, at)


def _by_error_rate(scenario: Scenario, at: Mapping[NodeId, Enu]) -> Chance:
    """The error rates at the signal to interference and noise ratio; numpy is imported for these channels only."""
    import numpy as np

    from emulator.channel.link_budget import milliwatt, noise_mw, received_dbm
    from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB

    radio = scenario.radio
    parts, noise = _parts_of_frame(scenario), noise_mw(radio)

    @cache
    def power_dbm(sender: NodeId, receiver: NodeId) -> float:
        from_m, to_m = (np.array([tuple(at[node])]) for node in (sender, receiver))
        distance = np.array([at[sender].minus(at[receiver]).norm()])
        return float(received_dbm(distance, from_m, to_m, radio)[0]) + _gain_dbi(scenario, sender, receiver)

    @cache
    def chance(sender: NodeId, receiver: NodeId, others: tuple[NodeId, ...]) -> float:
        wanted_dbm = power_dbm(sender, receiver)
        interference = math.fsum(milliwatt(power_dbm(other, receiver)) for other in others if other != receiver)
        sinr_db = wanted_dbm - 10 * math.log10(noise + interference)
        if wanted_dbm < radio.sensitivity_dbm or sinr_db < radio.preamble_snr_db or receiver in others:
            return 0.0
        row = int((sinr_db - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB)
        return math.exp(sum(bits * float(table[min(row, len(table) - 1)]) for bits, table in parts))

    return chance


def _by_range(scenario: Scenario, at: Mapping[NodeId, Enu]) -> Chance:
    """1 if exactly one sender is within range of the receiver, which does not send itself."""
    heard = within_range(at, range_m=scenario.radio.range_m, reaches=scenario.reaches)

    @cache
    def near(receiver: NodeId) -> frozenset[NodeId]:
        return frozenset((receiver, *heard[receiver]))

    def chance(sender: NodeId, receiver: NodeId, others: tuple[NodeId, ...]) -> float:
        senders = (sender, *others)
        return float(receiver not in senders and sum(map(near(receiver).__contains__, senders)) == 1)

    return chance


def _gain_dbi(scenario: Scenario, *ends: NodeId) -> float:
    """By how much a link between these nodes is stronger because of the post's antenna."""
    return scenario.ground.gain_dbi if scenario.post in ends else 0.0
