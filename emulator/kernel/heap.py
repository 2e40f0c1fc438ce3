"""A binary heap of (t_ns, seq, kind, a, b) rows in an array, as plain functions that numba compiles."""

from emulator.kernel.jit import jit
from emulator.kernel.state import SEQ, Ints


@jit
def push(heap: Ints, g: Ints, size_at: int, t: int, kind: int, a: int, b: int) -> None:
    """Add an event to the heap whose size is in `g[size_at]`. The caller has made sure that there is room."""
    g[SEQ] += 1
    seq = g[SEQ]
    i = g[size_at]
    g[size_at] = i + 1
    while i > 0:
        up = (i - 1) >> 1
        if heap[up, 0] < t or (heap[up, 0] == t and heap[up, 1] < seq):
            break
        heap[i, 0], heap[i, 1], heap[i, 2], heap[i, 3], heap[i, 4] = (
            heap[up, 0], heap[up, 1], heap[up, 2], heap[up, 3], heap[up, 4],
        )  # fmt: skip
        i = up
    heap[i, 0], heap[i, 1], heap[i, 2], heap[i, 3], heap[i, 4] = t, seq, kind, a, b


@jit
def pop(heap: Ints, g: Ints, size_at: int) -> None:
    n = g[size_at] - 1
    g[size_at] = n
    if n == 0:
        return
    t, seq, kind, a, b = heap[n, 0], heap[n, 1], heap[n, 2], heap[n, 3], heap[n, 4]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= n:
            break
        other = child + 1
        if other < n and (
            heap[other, 0] < heap[child, 0] or (heap[other, 0] == heap[child, 0] and heap[other, 1] < heap[child, 1])
        ):
            child = other
        if t < heap[child, 0] or (t == heap[child, 0] and seq < heap[child, 1]):
            break
        heap[i, 0], heap[i, 1], heap[i, 2], heap[i, 3], heap[i, 4] = (
            heap[child, 0], heap[child, 1], heap[child, 2], heap[child, 3], heap[child, 4],
        )  # fmt: skip
        i = child
    heap[i, 0], heap[i, 1], heap[i, 2], heap[i, 3], heap[i, 4] = t, seq, kind, a, b
