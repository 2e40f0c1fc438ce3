"""What a guard time must hold: both clocks' errors, flight, and the last frame."""

from fanet_mw.bounds.slot_service import Dcf, slot_guard_ns
from fanet_mw.scenario import config
from fanet_mw.units import US


def test_the_windows_that_a_bound_counts_double_up_to_the_greatest() -> None:
    assert [Dcf().window(attempt) for attempt in range(7)] == [31, 63, 127, 255, 511, 1023, 1023]


def test_a_bound_counts_with_the_constants_of_the_scenarios_radio() -> None:
    assert Dcf.of(config.build({}).radio) == Dcf(), "802.11b with a long preamble"
    assert Dcf.of(config.build({"radio": {"max_attempts": 4}}).radio).attempts == 4


def test_a_guard_that_is_left_to_us_holds_a_frame_with_all_that_is_sent_around_its_payload() -> None:
    """1,024 B and 64 around them at 11 Mb/s: 192 + 792 us; 250 m are 0.834 us."""
    scenario = config.build({"clusters": {"guard_ms": "auto"}, "radio": {"range_m": 250}})
    assert scenario.traffic.payload_bytes == 1024
    assert slot_guard_ns(scenario, clock_error_ns=0) == 984 * US + 834
    assert slot_guard_ns(scenario, clock_error_ns=3 * US) == 990 * US + 834
