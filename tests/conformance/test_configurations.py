"""The constants of AODV, OLSR and address resolution as RFCs list them; where they leave a choice, ns-3's."""

from fanet_mw.routing import address_resolution
from fanet_mw.routing.aodv import parameters as aodv
from fanet_mw.routing.olsr import parameters as olsr
from fanet_mw.units import MS, S


def test_aodv_has_the_values_of_rfc_3561_section_10() -> None:
    assert aodv.ACTIVE_ROUTE_TIMEOUT_NS == 3 * S
    assert (aodv.ALLOWED_HELLO_LOSS, aodv.HELLO_INTERVAL_NS) == (2, 1 * S)
    assert (aodv.NET_DIAMETER, aodv.NODE_TRAVERSAL_TIME_NS) == (35, 40 * MS)
    assert aodv.NET_TRAVERSAL_TIME_NS == 2800 * MS
    assert aodv.PATH_DISCOVERY_TIME_NS == 5600 * MS
    assert aodv.BLACKLIST_TIMEOUT_NS == 5600 * MS
    assert (aodv.RREQ_RETRIES, aodv.RREQ_RATELIMIT, aodv.RERR_RATELIMIT) == (2, 10, 10)
    assert (aodv.TTL_START, aodv.TTL_INCREMENT, aodv.TTL_THRESHOLD, aodv.TIMEOUT_BUFFER) == (1, 2, 7, 2)
    assert aodv.MY_ROUTE_TIMEOUT_NS == 11_200 * MS, "ns-3's: twice the path discovery time, which is the longer"
    assert aodv.DELETE_PERIOD_NS == 15 * S


def test_olsr_has_the_values_of_rfc_3626_section_18() -> None:
    assert (olsr.HELLO_INTERVAL_NS, olsr.REFRESH_INTERVAL_NS, olsr.TC_INTERVAL_NS) == (2 * S, 2 * S, 5 * S)
    assert (olsr.NEIGHB_HOLD_TIME_NS, olsr.TOP_HOLD_TIME_NS) == (6 * S, 15 * S)
    assert olsr.MAXJITTER_NS == 500 * MS
    names = (olsr.WILL_NEVER, olsr.WILL_LOW, olsr.WILL_DEFAULT, olsr.WILL_HIGH, olsr.WILL_ALWAYS)
    assert names == (0, 1, 3, 6, 7)


def test_address_resolution_has_the_values_of_ns_3_s_arp() -> None:
    assert (address_resolution.REQUEST_JITTER_NS, address_resolution.WAIT_REPLY_NS) == (10 * MS, 1 * S)
    assert (address_resolution.MAX_RETRIES, address_resolution.PENDING) == (3, 3)
    assert (address_resolution.ALIVE_NS, address_resolution.DEAD_NS) == (120 * S, 100 * S)
