"""Slots of heads: by `slot_access` members send packets to their head, which floods them in its slot; `slot_release` is
the queue that is emptied then.
"""
