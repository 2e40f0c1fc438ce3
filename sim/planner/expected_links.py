"""The expected quality of each link before take-off, by the emulator's channel model: power, and share of received
frames.

    mean power (path loss; shadowing of another seed than the run's) -> gains of fading -> mean success of a frame

The frames are those of the application, and no other node transmits, as in turns. Obstacles are not considered.
"""

import math
from collections.abc import Mapping
from typing import Final

from fanet_mw.airtime import OVERHEAD_BYTES, Timing
from fanet_mw.rng import stream, stream_seed
from fanet_mw.routing.clustered.links.link_quality import STEADY
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.links import Link, grade_of, power_of

_GAINS: Final = 400
_LEAST: Final = 0.02
"""Links with a smaller share are received too rarely to be known."""


def expected_links(scenario: Scenario, at: Mapping[NodeId, Enu], *, draw: int) -> tuple[Link, ...]:
    """One entry per pair of nodes that receive each other; `draw` is the number of the draw of shadowing."""
    import numpy as np

    from emulator.channel.error_rate import header_rates, log_success_per_bit
    from emulator.channel.link_budget import noise_mw, received_dbm
    from emulator.channel.shadowing import Shadowing
    from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB

    radio, nodes = scenario.radio, sorted(at)
    places = np.array([tuple(at[node]) for node in nodes], dtype=np.float64)
    pairs = np.argwhere(np.triu(np.ones((len(nodes), len(nodes)), dtype=bool), 1)).astype(np.int64)
    ends = places[pairs[:, 0]], places[pairs[:, 1]]
    distance = np.linalg.norm(ends[0] - ends[1], axis=1)
    mean_dbm = received_dbm(distance, *ends, radio)
    if radio.shadowing_db:
        field = Shadowing(radio, seed=stream_seed(draw, "plan"))
        mean_dbm = mean_dbm - field.loss_db(places, pairs, distance)
    if radio.channel == "range":
        success = (distance <= radio.range_m).astype(np.float64)
    else:
        power_dbm = mean_dbm[:, None] + 10 * np.log10(np.array(_gains(radio)))[None, :]
        snr_db = power_dbm - 10 * math.log10(noise_mw(radio))
        header_rate, bits_per_ns = header_rates(radio.rate_mbps)
        frame_bits = 8 * (scenario.traffic.payload_bytes + OVERHEAD_BYTES)
        logs = sum(
            bits * table[np.clip(((snr_db - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB).astype(int), 0, len(table) - 1)]
            for bits, table in (
                (Timing.of(radio).header_ns * bits_per_ns, log_success_per_bit(header_rate)),
                (frame_bits, log_success_per_bit(radio.rate_mbps)),
            )
        )
        heard = (power_dbm >= radio.sensitivity_dbm) & (snr_db >= radio.preamble_snr_db)
        success = np.where(heard, np.exp(logs), 0.0).mean(axis=1)
    return tuple(
        Link(nodes[a], nodes[b], grade_of(min(STEADY, float(share))), power_of(float(dbm)))
        for (a, b), share, dbm in zip(pairs.tolist(), success, mean_dbm, strict=True)
        if share >= _LEAST
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
