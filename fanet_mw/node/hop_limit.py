"""The hop limit: how many more hops a packet may travel, so that none travels forever.

    hop_limit    the hops that are left, as the frame states; the origin begins with `routing.hop_limit`
    hops         the hops that the packet has made

A packet that is heard with a hop limit of 1 has made its last hop: the node may deliver it, but passes it on to no one.
The part that would have passed it on drops it by the reason `hop_limit`.
"""

from fanet_mw.wire import Header


def is_used_up(header: Header) -> bool:
    """True if a packet that was heard with this header may not be passed on."""
    return header.hop_limit <= 1
