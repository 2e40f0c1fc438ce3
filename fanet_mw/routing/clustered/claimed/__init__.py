"""TDMA slots that the nodes agree on among themselves, without a leader (`clusters.relay = "claimed"`)."""
