"""One node under any routing protocol: identity, duplicates, queue, neighbors, and the contract of a protocol."""
