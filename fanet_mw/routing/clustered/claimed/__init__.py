"""Slots that nodes claim over the air, without a leader: `clusters.relay = "claimed"`."""
