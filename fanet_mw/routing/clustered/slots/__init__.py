"""Slots of heads: `slot_access` brings members' packets to the head, whose queue `slot_release` empties in its slot."""
