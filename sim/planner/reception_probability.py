"""The probability that a frame is received against noise and other senders of its turn, by the emulator's error rates.

Interference is assumed to last for the whole frame, which is the worst case. Fading and shadowing are refused: with
shadowing the losses of successive frames are not independent, and fading would have to be averaged over draws.
"""

import math
from collections.abc import Mapping
from functools import cache

from fanet_mw.airtime import OVERHEAD_BYTES, Timing
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId
from sim.planner.flood_loss import Chance


def chance_of(scenario: Scenario, at: Mapping[NodeId, Enu]) -> Chance | None:
    """The `Chance` of the application's frames; None with fading, shadowing or obstacles."""
    radio = scenario.radio
    if radio.fading != "none" or radio.shadowing_db > 0 or scenario.world.has_obstacles:
        return None
    if radio.channel == "range":
        return lambda sender, receiver, others: _clear(at, receiver, (sender, *others), radio.range_m)
    return _by_error_rate(scenario, at)


def _by_error_rate(scenario: Scenario, at: Mapping[NodeId, Enu]) -> Chance:
    """The error rates at the signal to interference and noise ratio; numpy is imported for these channels only."""
    import numpy as np

    from emulator.channel.error_rate import header_rates, log_success_per_bit
    from emulator.channel.link_budget import milliwatt, noise_mw, received_dbm
    from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB

    radio = scenario.radio
    header_rate, bits_per_ns = header_rates(radio.rate_mbps)
    tables = log_success_per_bit(header_rate), log_success_per_bit(radio.rate_mbps)
    bits = Timing.of(radio).header_ns * bits_per_ns, 8 * (scenario.traffic.payload_bytes + OVERHEAD_BYTES)
    noise = noise_mw(radio)

    @cache
    def power_dbm(sender: NodeId, receiver: NodeId) -> float:
        from_m, to_m = (np.array([tuple(at[node])]) for node in (sender, receiver))
        distance = np.array([at[sender].minus(at[receiver]).norm()])
        return float(received_dbm(distance, from_m, to_m, radio)[0])

    @cache
    def chance(sender: NodeId, receiver: NodeId, others: tuple[NodeId, ...]) -> float:
        wanted_dbm = power_dbm(sender, receiver)
        interference = math.fsum(milliwatt(power_dbm(other, receiver)) for other in others if other != receiver)
        sinr_db = wanted_dbm - 10 * math.log10(noise + interference)
        if wanted_dbm < radio.sensitivity_dbm or sinr_db < radio.preamble_snr_db or receiver in others:
            return 0.0
        row = int((sinr_db - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB)
        return math.exp(
            sum(count * float(table[min(row, len(table) - 1)]) for count, table in zip(bits, tables, strict=True))
        )

    return chance


def _clear(at: Mapping[NodeId, Enu], receiver: NodeId, senders: tuple[NodeId, ...], range_m: float) -> float:
    """1 if exactly one sender is within range of the receiver, which does not send itself."""
    heard = sum(at[receiver].minus(at[sender]).norm() <= range_m for sender in senders)
    return float(heard == 1 and receiver not in senders)
