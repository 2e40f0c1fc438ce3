"""Swarm instants out of unix time and a scale."""

import time

import pytest

from fanet_mw.bus.messages import ClockEpoch, ClockState
from fanet_mw.hosts.clock import SwarmClock
from fanet_mw.units import S


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_swarm_time_is_unix_time_since_the_epoch_times_the_scale(scale: float) -> None:
    clock = SwarmClock(ClockEpoch(time.time_ns() - 100 * S, scale, ClockState.RUNNING))
    assert clock.now_ns() / S == pytest.approx(100 * scale, abs=1)
    assert clock.wait_s(round((100 * scale + 30) * S)) == pytest.approx(30 / scale, abs=2)
    assert clock.wait_s(0) < 0, "it has passed"
