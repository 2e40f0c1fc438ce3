"""What ns-3 hears otherwise than the standard has it, by timelines: `radio.access = "ns3"` over a channel with powers.

Log-distance, exponent 3, 30 dBm: sensed and decoded up to 250 m (-82 dBm). At 283 m a frame arrives with -83.6 dBm, too
weak to be sensed; two of them together have -80.6 dBm. A frame from 200 m stands 4.5 dB above one from 283 m: enough
for its preamble, far too little for its 8,704 bits.
"""

import pytest
from hand_driven import Air, receptions, statuses
from kit import MakeScenario

from fanet_mw.units import MS, US

FRAME_NS, DIFS_NS, SLOT_NS = 984 * US, 50 * US, 20 * US
WEAK_NS = 944
"""283 m at the speed of light."""


def air(make_scenario: MakeScenario, access: str | list[str], places_m: list[float], *, seed: int = 1) -> Air:
    keys = {"nodes.count": len(places_m), "radio.channel": "log_distance", "radio.access": access, "seed": seed,
            "radio.sensitivity_dbm": -82, "radio.preamble_snr_db": 4}  # fmt: skip
    return Air(make_scenario(**keys), places_m)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("access", ["ns3", ["difs", "sums"]])
def test_signals_too_weak_to_be_sensed_are_sensed_together_as_ns3_has_it(
    make_scenario: MakeScenario, access: str | list[str], seed: int
) -> None:
    between = air(make_scenario, access, [0, 283, -283], seed=seed)
    between.send(2, 1000 * US)
    between.send(3, 1100 * US)
    between.send(1, 1300 * US)
    ended_ns = {node: end_ns for node, _, end_ns, _ in statuses(between.run())}
    one_left_ns = 1000 * US + DIFS_NS + FRAME_NS + WEAK_NS
    waited_ns = ended_ns[1] - FRAME_NS - one_left_ns - DIFS_NS
    assert waited_ns % SLOT_NS == 0
    assert 0 <= waited_ns <= 31 * SLOT_NS


@pytest.mark.parametrize(("access", "senders"), [("ns3", [2]), ("standard", [2, 3]), (["eifs", "onset"], [2, 3])])
def test_one_of_them_alone_is_not_sensed_nor_are_they_by_the_standard(
    make_scenario: MakeScenario, access: str | list[str], senders: list[int]
) -> None:
    between = air(make_scenario, access, [0, 283, -283])
    for sender in senders:
        between.send(sender, 900 * US + sender * 50 * US)
    between.send(1, 1300 * US)
    ended_ns = {node: end_ns for node, _, end_ns, _ in statuses(between.run())}
    assert ended_ns[1] == 1300 * US + (DIFS_NS if access == "ns3" else 0) + FRAME_NS


@pytest.mark.parametrize(
    ("access", "ahead_ns", "heard"),
    [
        ("ns3", 2 * US, [2]),
        ("ns3", 4 * US, [2]),
        ("ns3", 5 * US, []),
        ("ns3", -2 * US, []),
        ("standard", 2 * US, []),
        ("standard", 5 * US, []),
        (["onset"], 2 * US, [2]),
        (["difs", "eifs", "sums"], 2 * US, []),
    ],
)
def test_a_weaker_signal_less_than_a_detection_window_ahead_is_overseen_as_ns3_has_it(
    make_scenario: MakeScenario, access: str | list[str], ahead_ns: int, heard: list[int]
) -> None:
    listener = air(make_scenario, access, [0, 200, -283])
    listener.send(2, 1 * MS)
    listener.send(3, 1 * MS - ahead_ns)
    assert [src for node, src, _ in receptions(listener.run()) if node == 1] == heard


def test_what_was_overseen_harms_again_when_the_power_changes(make_scenario: MakeScenario) -> None:
    listener = air(make_scenario, "ns3", [0, 200, -283, 600])
    listener.send(2, 1 * MS)
    listener.send(3, 1 * MS - 2 * US)
    listener.send(4, 1 * MS + 300 * US)
    assert [src for node, src, _ in receptions(listener.run()) if node == 1] == []
