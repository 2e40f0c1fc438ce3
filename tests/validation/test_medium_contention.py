"""Contention on one channel, against ns-3.44, its published Bianchi validation, and Bianchi's closed form.

ns-3 figures are means and standard deviations over 5 seeds: 802.11b, 11 Mb/s, long preamble, 1024 bytes, access "ns3".
The model has no parameter fitted to them. A figure agrees within 0.02, 3 % or 3 standard deviations, the widest.
"""

import statistics
from collections.abc import Iterator
from typing import NamedTuple

import pytest
from kit import slow
from medium_driver import contention, disc
from reference import bianchi

from fanet_mw.units import NodeId

SINK = NodeId(1)
CHANNEL = {"A": "range", "B": "log_distance"}
SLOW = pytest.mark.slow


class Reference(NamedTuple):
    """A figure of another simulator."""

    mean: float
    sd: float = 0.0

    def tolerance(self, relative: float) -> float:
        return max(0.02 if not relative else relative * self.mean, 3 * self.sd)


@pytest.fixture(scope="module")
def table() -> Iterator[list[str]]:
    """Lines of ours against theirs, printed when the module is through (`pytest -s`)."""
    lines: list[str] = []
    yield lines
    print("\n" + "\n".join(lines))


def compare(table: list[str], what: str, ours: list[float], theirs: Reference, *, relative: float = 0.0) -> None:
    mean = statistics.fmean(ours)
    table.append(f"{what:55} ours {mean:7.4f}   ns-3 {theirs.mean:7.4f} +- {theirs.sd:.4f}   {mean - theirs.mean:+.4f}")
    assert mean == pytest.approx(theirs.mean, abs=theirs.tolerance(relative)), what


@pytest.mark.parametrize(
    ("channel", "count", "interval_s", "seeds", "pdr_air", "busy"),
    [
        ("A", 2, 0.001, 3, Reference(0.940449, 0.005529), 0.82268),
        ("A", 10, 0.001, 1, Reference(0.572999, 0.007646), 0.912575),
        ("A", 10, 0.01, 2, Reference(0.806515, 0.004867), 0.882084),
        ("A", 10, 0.02, 5, Reference(0.97725, 0.026539), 0.484591),
        ("A", 10, 0.1, 5, Reference(0.9985, 0.003354), 0.097967),
        ("A", 45, 0.02, 1, Reference(0.132547, 0.002897), 0.929189),
        ("A", 45, 0.1, 1, Reference(0.981889, 0.020726), 0.437031),
        pytest.param("B", 2, 0.001, 3, Reference(0.940449, 0.005529), 0.82268, marks=SLOW),
        ("B", 10, 0.005, 2, Reference(0.664202, 0.010196), 0.911788),
        pytest.param("B", 10, 0.01, 3, Reference(0.849086, 0.002585), 0.881998, marks=SLOW),
        ("B", 10, 0.02, 5, Reference(0.983133, 0.019844), 0.484433),
        ("B", 45, 0.02, 1, Reference(0.250617, 0.00152), 0.929246),
        ("B", 45, 0.1, 1, Reference(0.985513, 0.017449), 0.436786),
        pytest.param("A", 45, 0.001, 3, Reference(0.086792, 0.002894), 0.930484, marks=SLOW),
        pytest.param("A", 45, 0.01, 3, Reference(0.086622, 0.002845), 0.930499, marks=SLOW),
        pytest.param("B", 45, 0.001, 3, Reference(0.209541, 0.003195), 0.930026, marks=SLOW),
        pytest.param("B", 45, 0.01, 3, Reference(0.211811, 0.002814), 0.930105, marks=SLOW),
    ],
)
def test_stations_in_a_disc_that_all_broadcast_lose_as_many_copies_to_collisions_as_in_ns3(
    table: list[str], channel: str, count: int, interval_s: float, seeds: int, pdr_air: Reference, busy: float
) -> None:
    duration_s = 4.0 if interval_s < 0.1 else 8.0
    reports = [
        contention(
            disc(count, seed=seed), interval_s=interval_s, sources=range(1, count + 1), duration_s=duration_s,
            seed=seed, channel=CHANNEL[channel], access="ns3",
        )["air"]
        for seed in range(1, seeds + 1)
    ]  # fmt: skip
    case = f"broadcast {channel} n={count} every {interval_s:g} s"
    compare(table, f"{case}: PDR on the air", [report["pdr"] for report in reports], pdr_air)
    compare(table, f"{case}: busy", [report["busy"] for report in reports], Reference(busy))


@pytest.mark.parametrize("access", ["ns3", *slow("standard")])
@pytest.mark.parametrize(
    ("sources", "interval_s", "mbps", "failure", "retries"),
    [
        (1, 0.001, Reference(5.263155, 0.006922), Reference(0.000039), Reference(0.000039)),
        (5, 0.004, Reference(5.628928, 0.022235), Reference(0.176442, 0.005468), Reference(0.214286, 0.008071)),
        (44, 0.04, Reference(4.597023, 0.014718), Reference(0.512909, 0.002999), Reference(1.036227, 0.012486)),
    ],
)
def test_saturated_unicast_reaches_the_throughput_of_ns3(
    table: list[str],
    access: str,
    sources: int,
    interval_s: float,
    mbps: Reference,
    failure: Reference,
    retries: Reference,
) -> None:
    air = contention(
        disc(sources + 1), interval_s=interval_s, sources=range(2, sources + 2), dst=SINK, duration_s=12, warmup_s=2,
        lifetime_ms=1e6, access=access,
    )["air"]  # fmt: skip
    case = f"saturated unicast {access} n={sources}"
    compare(table, f"{case}: Mb/s", [air["throughput_mbps"]], mbps, relative=0.03)
    compare(table, f"{case}: failed attempts", [air["attempt_failure"]], failure)
    compare(table, f"{case}: retries", [air["mean_retries"]], retries, relative=0.03 if sources > 1 else 0.0)


@pytest.mark.parametrize(
    ("sources", "interval_s", "seeds", "pdr", "retries"),
    [
        (2, 0.01, 1, Reference(1.0), Reference(0.0)),
        (10, 0.01, 1, Reference(0.68185, 0.005708), Reference(0.397981, 0.011268)),
        (10, 0.02, 1, Reference(1.0), Reference(0.0236, 0.021141)),
        (44, 0.05, 1, Reference(0.684091, 0.006921), Reference(0.94709, 0.032389)),
        pytest.param(44, 0.1, 2, Reference(1.0), Reference(0.031934, 0.024916), marks=SLOW),
        pytest.param(44, 0.01, 1, Reference(0.128136, 0.000804), Reference(1.051122, 0.020722), marks=SLOW),
        pytest.param(44, 0.02, 1, Reference(0.258295, 0.000923), Reference(1.024287, 0.014574), marks=SLOW),
    ],
)
def test_unicast_under_load_loses_to_the_queue_lifetime_what_it_loses_in_ns3(
    table: list[str], sources: int, interval_s: float, seeds: int, pdr: Reference, retries: Reference
) -> None:
    reports = [
        contention(
            disc(sources + 1, seed=seed), interval_s=interval_s, sources=range(2, sources + 2), dst=SINK,
            duration_s=16, drain_s=1, seed=seed, access="ns3",
        )
        for seed in range(1, seeds + 1)
    ]  # fmt: skip
    case = f"unicast n={sources} every {interval_s:g} s"
    compare(table, f"{case}: PDR", [report["pdr_generated"] for report in reports], pdr)
    compare(table, f"{case}: retries", [report["air"]["mean_retries"] for report in reports], retries, relative=0.05)


@pytest.mark.parametrize(
    ("unicast", "interval_s", "pdr", "retries"),
    [
        (False, 0.01, Reference(0.810645, 0.003365), None),
        (False, 0.1, Reference(0.979268, 0.010925), None),
        (True, 0.01, Reference(0.99665, 0.001021), Reference(0.611609, 0.021101)),
        (True, 0.1, Reference(1.0), Reference(0.051643, 0.019383)),
    ],
)
def test_hidden_terminals_collide_in_the_middle_as_often_as_in_ns3(
    table: list[str], unicast: bool, interval_s: float, pdr: Reference, retries: Reference | None
) -> None:
    """Stations at 0, 200 and 400 m; the ends, deaf to each other, send to the middle as Poisson processes."""
    reports = [
        contention(
            [(0, 0), (200, 0), (400, 0)], interval_s=interval_s, sources=[1, 3], arrivals="poisson",
            duration_s=61, drain_s=1, seed=seed, access="ns3", **({"dst": NodeId(2)} if unicast else {}),
        )
        for seed in (1, 2)
    ]  # fmt: skip
    case = f"hidden {'unicast' if unicast else 'broadcast'} every {interval_s:g} s"
    share = 1 if unicast else 2  # of two targets of a broadcast only the middle is in range
    compare(table, f"{case}: PDR", [share * report["pdr_generated"] for report in reports], pdr)
    if retries is not None:
        compare(table, f"{case}: retries", [r["air"]["mean_retries"] for r in reports], retries, relative=0.05)


@pytest.mark.parametrize(
    ("count", "mbps"),
    [(5, 6.4734), (20, 5.7819), pytest.param(35, 5.4191, marks=SLOW), pytest.param(50, 5.1745, marks=SLOW)],
)
def test_saturation_throughput_is_that_of_ns3s_published_bianchi_validation(
    table: list[str], count: int, mbps: float
) -> None:
    """1500 bytes above LLC, ACKs at 2 Mb/s, no retry limit; the column for DIFS after a collision.

    Stations of equal power that start together are not detected here, so no EIFS follows: 1472 + UDP + IPv4 bytes.
    """
    air = contention(
        disc(count, radius_m=1), interval_s=0.0005 * count, sources=range(1, count + 1), dst=None, size=1472,
        duration_s=12, warmup_s=3, lifetime_ms=1e6, ack_rate_mbps=2.0, max_attempts=255,
    )["air"]  # fmt: skip
    ours = [air["throughput_mbps"] * 1500 / 1472]
    compare(table, f"Bianchi 1500 B n={count}: Mb/s", ours, Reference(mbps), relative=0.015)


@pytest.mark.parametrize("count", [3, 10, 25])
def test_saturated_unicast_follows_bianchis_closed_form_between_the_tables(table: list[str], count: int) -> None:
    mbps, failure = bianchi(count, success_us=984 + 10 + 203 + 50, collision_us=984 + 50, payload_bytes=1024)
    air = contention(
        disc(count, radius_m=50), interval_s=0.0008 * count, sources=range(1, count + 1), dst=None, duration_s=10,
        warmup_s=2, lifetime_ms=1e6,
    )["air"]  # fmt: skip
    compare(table, f"closed form n={count}: Mb/s", [air["throughput_mbps"]], Reference(mbps), relative=0.03)
    compare(table, f"closed form n={count}: failed attempts", [air["attempt_failure"]], Reference(failure))
