"""OFDM's error rates are those of ns-3.44, and a slower rate never needs more than a faster one."""

import numpy as np
import pytest
from ns3_models import Curve, curves

from emulator.channel.error_rate import log_success_per_bit
from fanet_mw.airtime import OFDM_RATES_MBPS


@pytest.mark.parametrize("curve", list(curves()), ids=lambda curve: f"{curve.model}-{curve.rate_mbps:g}-{curve.size}")
def test_as_many_frames_arrive_as_by_the_same_model_of_ns3(curve: Curve) -> None:
    assert np.abs(curve.ours - curve.arrive).max() < 0.001


@pytest.mark.parametrize("model", ["nist", "tables"])
@pytest.mark.parametrize("short", [True, False])
def test_a_slower_rate_needs_no_more_than_a_faster_one(model: str, short: bool) -> None:
    halves = [
        int((log_success_per_bit(rate, model, short=short) > np.log(0.5) / 8000).argmax()) for rate in OFDM_RATES_MBPS
    ]
    assert halves == sorted(halves)
