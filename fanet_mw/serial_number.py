"""Sequence numbers that wrap: comparison by signed difference (RFC 3561, 6.1; RFC 3626, 19; RFC 1982)."""


def newer(a: int, b: int, *, bits: int = 32) -> bool:
    """True if `a` comes after `b`; of numbers half the range apart neither comes after the other."""
    return 0 < ((a - b) & ((1 << bits) - 1)) < 1 << (bits - 1)


def later(a: int, b: int, *, bits: int = 32) -> int:
    """The one of two numbers that comes after the other."""
    return a if newer(a, b, bits=bits) else b


def following(a: int, *, step: int = 1, bits: int = 32) -> int:
    return (a + step) & ((1 << bits) - 1)
