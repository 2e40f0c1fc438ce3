"""Overrides as `--set KEY=VALUE`."""

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config


def scenario(*overrides: str, text: str = "") -> Scenario:
    return config.parse(text, source="a.toml", name="a", overrides=overrides)


@pytest.mark.parametrize("override", ["nodes.count", "=3", "seed.x=1"])
def test_an_override_that_is_none_is_refused_with_its_text(override: str) -> None:
    with pytest.raises(ConfigError) as caught:
        scenario(override, text="seed = 1")
    assert repr(override) in str(caught.value)


def test_overrides_take_toml_values_and_plain_words() -> None:
    made = scenario("nodes.count=10", "routing.protocol=flooding", "traffic.sources=[1, 2]")
    assert made.nodes.count == 10
    assert made.routing.protocol == "flooding"
    assert made.traffic.sources == (1, 2)


def test_an_override_sets_one_key_only() -> None:
    with pytest.raises(ConfigError, match=r"nodes\.count = '3\\nseed=2'"):
        scenario("nodes.count=3\nseed=2")


def test_an_entry_of_an_array_is_changed_by_its_number() -> None:
    text = '[[faults]]\nkind = "cut"\nnode = 2\nat_s = 3\n'
    assert scenario("faults.0.node=4", text=text).faults[0].node == 4  # type: ignore[union-attr]
    for wrong in ("faults.1.node=4", "faults.x.node=4"):
        with pytest.raises(ConfigError, match="must be the number of an entry, 0 to 0"):
            scenario(wrong, text=text)
