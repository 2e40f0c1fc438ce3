"""Named random streams: one stream per use, derived from text, so that no two uses share or shift draws."""

from random import Random


def stream(seed: int, *names: str | int) -> Random:
    """Return the generator for one named use, for example `stream(7, "backoff", node)`.

    `Random(str)` seeds by SHA-512 of the text: independent of PYTHONHASHSEED and of every other stream.
    """
    return Random("/".join(str(part) for part in (seed, *names)))


def stream_seed(seed: int, *names: str | int) -> int:
    """Return a 63-bit seed for a named use, for generators that are not `random.Random` (numpy, numba)."""
    return stream(seed, *names).getrandbits(63)
