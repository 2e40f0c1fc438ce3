"""One node under any routing protocol: identity, duplicates, queue, neighbors, and the contract of a protocol.

in        `reader` decodes a frame, `duplicates` knows it already, `header_check` refuses it, `hop_limit` ends its way
out       `packet_numbering` numbers own packets, `queue` keeps them, `port` transmits them
beside    `neighbors` by their hellos, `packet_watch` for applications, `contract` of a protocol, `node` for all
"""
