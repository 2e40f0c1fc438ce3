"""The rows of links.json."""

import pytest

from fanet_mw.bus.link_stats import LOSSES, LinkRow
from fanet_mw.units import NodeId
from sim.results.links import described


@pytest.mark.parametrize(("sum_mdbm", "rssi_dbm"), [(-280_000, -70.0), (0, None)])
def test_a_channel_without_powers_has_no_rssi(sum_mdbm: int, rssi_dbm: float | None) -> None:
    row = LinkRow(NodeId(1), NodeId(2), 4, (0,) * len(LOSSES), sum_mdbm)
    assert described([row])[0]["rssi_dbm"] == rssi_dbm
