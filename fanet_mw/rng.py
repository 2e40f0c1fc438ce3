"""Named random streams: one stream per use, seeded from text, so that no two uses share or shift their draws."""

from random import Random
from typing import Final


def stream(seed: int, *names: str | int) -> Random:
    """The generator of a named use: `stream(7, "backoff", node)`; by SHA-512 of the text, independent of others."""
    return Random("/".join(str(part) for part in (seed, *names)))


def stream_seed(seed: int, *names: str | int) -> int:
    """Return a 63-bit seed for a named use, for generators that are not `random.Random` (numpy, numba)."""
    return stream(seed, *names).getrandbits(63)


_MASK: Final = 0xFFFF_FFFF_FFFF_FFFF
_STEP: Final = 0x9E37_79B9_7F4A_7C15  # splitmix64 (Steele, Lea and Flood, OOPSLA 2014)
_FIRST: Final = 0xBF58_476D_1CE4_E5B9
_SECOND: Final = 0x94D0_49BB_1331_11EB


def priority_hash(node: int) -> int:
    """64 bits that every node computes alike, for what a swarm decides at random without a message or a seed."""
    x = node * _STEP & _MASK
    x = (x ^ x >> 30) * _FIRST & _MASK
    x = (x ^ x >> 27) * _SECOND & _MASK
    return x ^ x >> 31
