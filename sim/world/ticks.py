"""The instants at which the world moves: one per period, in phase, however late its host wakes it."""


class Ticks:
    """The instants of the next and of the last tick."""

    def __init__(self) -> None:
        self.next_ns: int | None = None
        """The instant of the next tick; None before the start."""
        self.last_ns = 0
        self.count = 0
        self.skipped = 0
        """The number of ticks that were skipped because they came too late."""

    def begin(self, now_ns: int, *, period_ns: int) -> None:
        """Start to count; the first tick is one period ahead."""
        self.last_ns = now_ns
        self.next_ns = now_ns + period_ns

    def resume(self, now_ns: int, *, tick_ns: int) -> None:
        """Continue after a time in which nothing moved: the next tick is one period ahead, and moves bodies for one
        period.
        """
        self.last_ns = max(self.last_ns, now_ns - tick_ns)
        self.next_ns = now_ns + tick_ns

    def follow(self, due_ns: int, now_ns: int, *, period_ns: int) -> None:
        """Plan the tick after the one at `due_ns`; after a stall, instants that have passed are skipped."""
        self.count += 1
        self.next_ns = due_ns + period_ns
        behind = (now_ns - self.next_ns) // period_ns
        if behind > 0:
            self.next_ns += behind * period_ns
            self.skipped += behind
