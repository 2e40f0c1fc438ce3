"""The rows of links.json."""

import pytest

from fanet_mw.bus.link_stats import LOSSES, LinkRow
from fanet_mw.units import NodeId
from sim.results.links import described


@pytest.mark.parametrize(("has_rssi", "rssi_dbm"), [(True, -70.0), (False, None)])
def test_a_channel_without_powers_has_no_rssi(has_rssi: bool, rssi_dbm: float | None) -> None:
    row = LinkRow(NodeId(1), NodeId(2), 4, (0,) * len(LOSSES), -280_000)
    assert described([row], has_rssi=has_rssi)[0]["rssi_dbm"] == rssi_dbm
