"""What a guard time must hold: both clocks' errors, their drift until the next setting, flight, and the last frame."""

from fanet_mw.bounds import guard_ns
from fanet_mw.bounds.guard_time import slot_guard_ns
from fanet_mw.bounds.slot_service import Dcf
from fanet_mw.scenario import config
from fanet_mw.units import MS, US, S

QUIET = {"clock_error_ns": 0, "drift_ppm": 0.0, "resync_ns": 0, "range_m": 0.0, "overhang_ns": 0}


def test_perfect_clocks_at_one_place_need_no_guard() -> None:
    assert guard_ns(**QUIET) == 0


def test_both_clocks_may_be_off_in_opposite_directions() -> None:
    assert guard_ns(**{**QUIET, "clock_error_ns": 50 * US}) == 100 * US
    assert guard_ns(**{**QUIET, "drift_ppm": 20.0, "resync_ns": 5 * S}) == 200 * US


def test_flight_and_the_last_frame_come_on_top() -> None:
    assert guard_ns(**{**QUIET, "range_m": 299.792458}) == 1 * US
    assert guard_ns(**{**QUIET, "clock_error_ns": 1 * MS, "overhang_ns": 984 * US}) == 2984 * US


def test_the_windows_that_a_bound_counts_double_up_to_the_greatest() -> None:
    assert [Dcf().window(attempt) for attempt in range(7)] == [31, 63, 127, 255, 511, 1023, 1023]


def test_a_guard_that_is_left_to_us_holds_a_frame_with_all_that_is_sent_around_its_payload() -> None:
    """1,024 B and 64 around them at 11 Mb/s: 192 + 792 us; 250 m are 0.834 us."""
    scenario = config.build({"clusters": {"guard_ms": "auto"}, "radio": {"range_m": 250}})
    assert scenario.traffic.payload_bytes == 1024
    assert slot_guard_ns(scenario, clock_error_ns=0) == 984 * US + 834
    assert slot_guard_ns(scenario, clock_error_ns=3 * US) == 990 * US + 834
