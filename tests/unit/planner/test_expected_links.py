"""What a plan expects of single frames is what the emulator computes for them."""

import numpy as np
import pytest

from emulator.kernel_arrays import _error_table
from fanet_mw.airtime import OVERHEAD_BYTES
from fanet_mw.units import Enu, NodeId
from sim.planner.expected_links import chance_of, expected_links
from sim.scenarios import catalog

ONE, TWO = NodeId(1), NodeId(2)
HEADER, DATA, SHORT_DATA = 0, 1, 3
HEADER_BITS = 24


@pytest.mark.parametrize("model", ["nist", "tables"])
@pytest.mark.parametrize(("payload", "row"), [(100, SHORT_DATA), (1000, DATA)])
def test_a_frame_is_lost_as_often_as_by_the_error_table_of_the_emulator(model: str, payload: int, row: int) -> None:
    keys = ("radio.standard=g", "radio.rate_mbps=24", "radio.channel=log_distance", "radio.fading=none",
            "radio.shadowing_db=0", "radio.sensitivity_dbm=-100", "radio.preamble_snr_db=-10",
            f"radio.ofdm_errors={model}", f"traffic.payload_bytes={payload}")  # fmt: skip
    scenario = catalog.find("clusters", keys)
    radio, partial = scenario.radio, 0
    table = _error_table(radio.rate_mbps, radio.ack_rate_mbps, model)
    by_sinr = np.exp(HEADER_BITS * table[HEADER] + 8 * (payload + OVERHEAD_BYTES) * table[row])
    for distance_m in range(50, 2000, 5):
        at = {ONE: Enu(0, 0, 50), TWO: Enu(distance_m, 0, 50)}
        chance = chance_of(scenario, at)
        assert chance is not None
        share = chance(ONE, TWO, ())
        if 0.02 < share < 0.99:
            partial += 1
            assert np.abs(by_sinr - share).min() < 1e-9, distance_m
            assert len(expected_links(scenario, at, draw=0)) == 1
    assert partial > 3


@pytest.mark.parametrize("channel", ["range", "log_distance"])
def test_the_gain_of_the_posts_antenna_makes_its_links_longer_both_ways_and_no_other(channel: str) -> None:
    keys = ("nodes.count=3", "clusters.count=2", "traffic.sources=2", "ground.at_m=[0,0]", f"radio.channel={channel}")
    post, far_m = NodeId(4), 270
    at = {ONE: Enu(0, 0, 50), TWO: Enu(far_m, 0, 50), NodeId(3): Enu(0, 9000, 50), post: Enu(-far_m, 0, 50)}

    def linked(*more: str) -> tuple[set[tuple[int, int]], list[bool]]:
        scenario = catalog.find("clusters", [*keys, *more])
        chance = chance_of(scenario, at)
        assert chance is not None
        pairs = (ONE, post), (post, ONE), (ONE, TWO)
        return {(link.a, link.b) for link in expected_links(scenario, at, draw=0)}, [
            chance(a, b, ()) > 0.5 for a, b in pairs
        ]

    power = ("radio.tx_power_dbm=25",)
    assert linked(*power) == (set(), [False] * 3)
    assert linked(*power, "ground.gain_dbi=6") == ({(ONE, post)}, [True, True, False])
