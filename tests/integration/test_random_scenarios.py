"""Whatever a valid scenario asks for, its run ends, raises nothing, wakes nobody without end, and accounts for all.

The draws are in `scenario_draws.py`; a thousand of them are the long run. What they once found stands here by name.
"""

import random
from collections.abc import Sequence

import pytest
import scenario_draws
import tomli_w
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples, slow

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.commented import commented
from fanet_mw.trace import Generated
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.scenarios import catalog


@pytest.mark.parametrize(
    "seed", [0, 5, *slow(2, 7)]
)  # 1 takes ten times as long as another; the long run has a thousand
def test_a_random_valid_scenario_ends_wakes_within_bounds_and_its_ledger_closes(seed: int) -> None:
    assert scenario_draws.check(seed, limit_s=60) == ""


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_thousand_random_valid_scenarios_end() -> None:
    assert [text for seed in range(1000) if (text := scenario_draws.check(seed))] == []


@examples(4)
@example(24)  # a rate that is the default, but not that of its standard
@given(st.integers(0, 10**6))
def test_a_scenario_that_is_shown_whole_or_by_its_departures_or_commented_is_read_back_as_itself(seed: int) -> None:
    shown, _ = scenario_draws.scenario(seed)
    whole, departures = shown.model_dump(mode="json", exclude_none=True), config.departures(shown)
    texts = [tomli_w.dumps(whole), tomli_w.dumps(departures), commented(whole), commented(departures, every_key=False)]
    for text in texts:
        assert config.parse(text, source="shown", name=shown.name) == shown


SATURATED = (
    "nodes.count=5",
    "clusters.count=1",
    "traffic.arrivals=saturated",
    "world.engine=kinematic",
    "warmup_s=0",
    "drain_s=0",
    "duration_s=0.5",
)


_REFUSING = {
    "no-lead": ("radio.lead_ms=0", "radio.queue_frames=1"),
    "queue-of-one": ("radio.queue_frames=1", "routing.queue_frames=1"),
    "no-lifetime": ("radio.lead_ms=0", "radio.lifetime_ms=0.001", "traffic.destination=1"),
    "cut-off": (
        "radio.lead_ms=0", "traffic.destination=2",
        'faults=[{kind="cut",at_s=0.2,node=3},{kind="cut",at_s=0.3,node=2}]',
    ),
}  # fmt: skip
_PROTOCOLS = ("direct", "clustered", "flooding", "aodv", "olsr", "dsdv", "geographic", "gossip")
_REFUSED = [
    pytest.param(protocol, keys, id=f"{name}-{protocol}", marks=[pytest.mark.slow] if (row + column) % 4 else [])
    for row, (name, keys) in enumerate(_REFUSING.items())
    for column, protocol in enumerate(_PROTOCOLS)
]
"""Each way with each protocol; by default each protocol meets one way, and each way two protocols."""


@pytest.mark.parametrize(("protocol", "keys"), _REFUSED)
def test_a_saturated_source_whose_radio_refuses_everything_does_not_offer_without_end(
    protocol: str, keys: Sequence[str]
) -> None:
    found = catalog.find("quick", [*SATURATED, f"routing.protocol={protocol}", *keys])
    summary = scenario_draws.run(found, limit_s=60)
    assert summary["frames"]["closes"], summary["frames"]
    assert summary["generated"] < 7_000


@pytest.mark.parametrize(
    ("protocol", "destination"),
    [
        ("direct", "1"), ("clustered", "all"), ("flooding", "all"), ("aodv", "1"), ("geographic", "1"),
        *slow(("direct", "all"), ("clustered", "1"), ("flooding", "1"), ("aodv", "all"), ("geographic", "all")),
    ],
)  # fmt: skip
def test_a_saturated_source_offers_packets_until_the_end(protocol: str, destination: str) -> None:
    end_s = 6 if protocol == "clustered" else 3  # its first turn is at 3 s
    keys = (f"routing.protocol={protocol}", f"traffic.destination={destination}", f"duration_s={end_s}")
    outcome = simulate(catalog.find("quick", [*SATURATED, *keys, "traffic.sources=1", "warmup_s=1"]))
    born_ns = [record.t_ns for record in outcome.records if isinstance(record, Generated) and record.app == "traffic"]
    assert min(born_ns) < 1.2 * S
    assert max(born_ns) > (end_s - 0.5) * S


def test_the_densest_traffic_that_a_scenario_may_ask_for_is_carried_or_counted() -> None:
    found = catalog.find(
        "quick",
        ["nodes.count=2", "clusters.count=1", "traffic.interval_s=1e-4", "warmup_s=0", "drain_s=0", "duration_s=0.5"],
    )
    summary = scenario_draws.run(found, limit_s=60)
    assert summary["generated"] > 9_000
    assert summary["frames"]["closes"]


@pytest.mark.parametrize("keys", [
    ("clusters.relay=scheduled", "radio.max_frame_bytes=680", "duration_s=8"),
    ("radio.max_frame_bytes=302",),
    *slow(
        (("clusters.relay=scheduled", "clusters.links=measured", "radio.max_frame_bytes=996"),),
        (("clusters.relay=counter", "clusters.repair_s=5", "radio.max_frame_bytes=385"),),
        (("clusters.relay=counter", "clusters.repair_s=0", "radio.max_frame_bytes=302", "clock.sync=beacons"),),
    ),
])  # fmt: skip
def test_a_swarm_whose_largest_messages_just_fit_a_frame_works(keys: Sequence[str]) -> None:
    size = (
        "nodes.count=30", "nodes.spacing_m=50", "traffic.payload_bytes=128", "traffic.interval_s=2", "duration_s=5",
        "warmup_s=2", "drain_s=1", "world.engine=kinematic", "mission.survivors=0",
    )  # fmt: skip
    summary = scenario_draws.run(catalog.find("quick", [*size, *keys]), limit_s=60)
    assert summary["frames"]["closes"]
    assert summary["delivered"] > 0


@pytest.mark.parametrize(("keys", "said"), [
    (("routing.hello_interval_s=0",), "needs hellos: routing.hello_interval_s > 0"),
    (("mission.lost_link_s=1",), "mission.lost_link_s = 1 needs hellos in shorter intervals, 0 < "
     "routing.hello_interval_s = 1 < 1"),
    (("routing.hello_interval_s=1e-10",), "routing.hello_interval_s = 1e-10 must be 0 or >= 0.01"),
    (("clusters.relay=scheduled", "radio.max_frame_bytes=679"), "radio.max_frame_bytes = 679 must be >= 680"),
    (("clusters.relay=scheduled", "clusters.links=measured", "nodes.count=30", "radio.max_frame_bytes=995"),
     "radio.max_frame_bytes = 995 must be >= 996 for links of timetables"),
    (("clusters.repair_s=5", "radio.max_frame_bytes=384"), "radio.max_frame_bytes = 384 must be >= 385"),
    (("radio.max_frame_bytes=301",), "radio.max_frame_bytes = 301 must be >= 302 for schedules"),
    (("traffic.interval_s=1e-10",), "traffic.interval_s = 1e-10: input should be greater than or equal to 0.0001"),
    (("radio.tx_power_dbm=1e308",), "radio.tx_power_dbm = 1e+308: input should be less than or equal to 300"),
    (("radio.tx_power_dbm=nan",), "radio.tx_power_dbm = nan: input should be a finite number"),
    (("sensors.radar_hz=1", "sensors.radar_resolution_m=0.001", "sensors.radar_false_alarm=0.01"),
     "radar_false_alarm = 0.01 makes 43200 false echoes in a scan of 4320000 cells; there must be at most 1000"),
])  # fmt: skip
def test_what_no_run_could_keep_is_refused_with_key_value_and_bound(keys: Sequence[str], said: str) -> None:
    with pytest.raises(ConfigError, match=said.replace("+", r"\+")):
        catalog.find("quick", ["traffic.payload_bytes=64", *keys])


@pytest.mark.parametrize("value", [1e308, 1e-10, -1e308, 10**400])
def test_every_numeric_key_takes_a_number_out_of_all_proportion_or_names_itself_and_its_bound(value: float) -> None:
    taken: list[Scenario] = []
    unnamed: list[str] = []
    for key in scenario_draws.every_key():
        try:
            taken.append(config.build(scenario_draws.tree({"nodes.count": 2, "clusters.count": 1, key.name: value})))
        except ConfigError as error:
            if key.name not in str(error):
                unnamed.append(f"{key.name}: {error}")
    assert unnamed == []
    for found in taken:  # what is taken works
        short = found.model_copy(update={"duration_s": 1.0, "warmup_s": 0.0, "drain_s": 0.0})
        assert scenario_draws.run(short, limit_s=60)["frames"]["closes"]


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("seed", [0, *slow(1, 2, 3)])
def test_a_large_swarm_in_which_heads_come_and_go_all_the_time_keeps_going(seed: int) -> None:
    """Above 56 nodes a schedule has several parts; a head that was replaced may come back between two of them."""
    pick = random.Random(seed)
    cuts = (
        f'{{kind="cut",node={pick.randint(2, 70)},at_s={pick.uniform(8, 35):.1f},for_s={pick.choice([3, 4, 6, 8])}}}'
        for _ in range(60)
    )
    keys = (
        "nodes.count=72", "nodes.spacing_m=150", "duration_s=45", "warmup_s=10", "drain_s=1", "clusters.count=8",
        "clusters.relay=counter", "clusters.reassign_s=0.5", "traffic.interval_s=2", "traffic.payload_bytes=128",
    )  # fmt: skip
    found = catalog.find("clusters", [*keys, f"seed={seed}", f"faults=[{','.join(cuts)}]"])
    summary = scenario_draws.run(found, limit_s=500)
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.6
