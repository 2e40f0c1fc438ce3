"""A number with a unit is understood or refused, and never taken for a number without one."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.quantities import in_unit_of, unit_of
from fanet_mw.scenario.reference import tables


def scenario(*overrides: str, text: str = "") -> Scenario:
    return config.parse(text, source="a.toml", name="a", overrides=overrides)


def test_an_exponent_is_no_unit() -> None:
    assert in_unit_of("duration_s", "1e1") is None
    assert scenario('duration_s="3e1"').duration_s == 30.0


@pytest.mark.parametrize(
    ("radio", "follows"),
    [
        ("frequency_mhz = {}5180{}", "reference_loss_db"),
        ("rate_mbps = {}2{}", "ack_rate_mbps"),
        ('standard = "g"\nnoise_figure_db = {}9{}', "energy_detection_dbm"),
    ],
)
def test_a_number_as_text_has_the_defaults_that_follow_from_a_number(radio: str, follows: str) -> None:
    """They were those of the default: 40.05 dB at 1 m for 5180 MHz."""
    head = '[radio]\nchannel = "log_distance"\n'
    plain, text = (scenario(text=head + radio.format(mark, mark)).radio for mark in ("", '"'))
    assert getattr(plain, follows) != getattr(scenario(text=head).radio, follows)
    assert text == plain


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("duration_s", "2 min", 120.0),
        ("duration_s", "90s", 90.0),
        ("duration_s", "9e1 s", 90.0),
        ("lead_ms", "0.06s", 60.0),
        ("lead_ms", "250 us", 0.25),
        ("area_m", "2.5km", 2500.0),
        ("speed_m_s", "36 km/h", 10.0),
        ("frequency_mhz", "2.412 GHz", 2412.0),
        ("tx_power_dbm", "-3 dBm", -3.0),
        ("payload_bytes", "1 kB", 1000.0),
        ("turn_slack_us", "50 µs", 50.0),
        ("turn_slack_us", "50 \u03bcs", 50.0),
        ("duration_s", "2\u00a0min", 120.0),
        ("tx_power_dbm", "\u22123 dBm", -3.0),
        ("acceleration_m_s2", "2 m/s\u00b2", 2.0),
    ],
)
def test_a_unit_of_the_keys_dimension_is_understood(key: str, text: str, value: float) -> None:
    assert in_unit_of(key, text) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("key", "text"),
    [("duration_s", "2 m"), ("area_m", "3 s"), ("count", "9 m"), ("tx_power_dbm", "1 mW"), ("seed", "3s")],
)
def test_any_other_unit_is_refused(key: str, text: str) -> None:
    with pytest.raises(ValueError, match="is not understood"):
        in_unit_of(key, text)


def test_the_longest_ending_counts() -> None:
    assert [unit_of(key) for key in ("speed_m_s", "area_m", "lead_ms", "rate_mbps", "noise_dbm", "count")] == [
        "m/s", "m", "ms", "Mb/s", "dBm", "",
    ]  # fmt: skip


@given(st.integers(1, 10**6))
def test_milliseconds_as_seconds_and_back_are_exact(value: int) -> None:
    assert in_unit_of("slot_ms", f"{value} ms") == value
    assert in_unit_of("slot_s", f"{value * 1000} ms") == value


def test_files_and_flags_understand_units_in_tables_too() -> None:
    made = scenario("radio.lead_ms=0.06s", "duration_s=2min", text='[world]\narea_m = "1.5 km"\n')
    assert (made.radio.lead_ms, made.duration_s, made.world.area_m) == (60.0, 120.0, 1500.0)


def test_a_unit_that_does_not_fit_names_key_value_and_units() -> None:
    with pytest.raises(ConfigError) as caught:
        scenario("radio.lead_ms=3 m", text='duration_s = "3 dB"')
    assert "radio.lead_ms = '3 m': 'm' is not understood: a number in ms, or with one of" in str(caught.value)
    assert "duration_s = '3 dB'" in str(caught.value)


def test_words_and_plain_text_stay_what_they_are() -> None:
    made = scenario("clusters.guard_ms=auto", "description=5 s", text='name = "a"\n[clusters]\nrelay = "scheduled"')
    assert made.clusters.guard_ms == "auto"
    assert made.description == "5 s"


_COUNTS = re.compile(r"\bin slots\b|\bthe shape\b|^(the )?(number of|share of|probability|how often)|exponent\b", re.I)


def test_no_key_whose_value_is_a_count_or_a_ratio_has_a_unit_by_the_ending_of_its_name() -> None:
    keys = [(table.path, key) for table in tables() for key in table.keys]
    assert len(keys) > 200
    wrong = [f"{path}.{key.name}" for path, key in keys if unit_of(key.name) and _COUNTS.search(key.meaning)]
    assert wrong == []
    assert {key.name for _, key in keys if "in slots" in key.meaning} >= {"cw_min", "cw_max"}


@pytest.mark.parametrize("value", ['radio.cw_min="1 h"', 'radio.nakagami_m="0.005km"', 'radio.max_attempts="5 s"'])
def test_a_unit_for_a_number_without_one_is_refused(value: str) -> None:
    with pytest.raises(ConfigError, match="unable to parse"):
        scenario(value)


@pytest.mark.parametrize(
    ("value", "key"),
    [
        ("nodes.count=true", "nodes.count"),
        ("duration_s=true", "duration_s"),
        ("world.no_fly_m=[[true,0,5]]", "world.no_fly_m"),
        ("traffic.sources=false", "traffic.sources"),
        ('faults=[{kind="cut",node=true,at_s=1}]', "faults.0.node"),
    ],
)
def test_true_is_no_number(value: str, key: str) -> None:
    with pytest.raises(ConfigError, match=f"^a.toml: {key}: must not be true or false$"):
        scenario(value)
    assert scenario("clock.sync=none", "routing.aggregate=true").routing.aggregate is True
