"""The ticks of the world: the instants at which it moves bodies and publishes their poses.

Ticks are one period apart. `begin` and `resume` set the phase. A host that wakes the world late does not shift later
ticks.
"""


class Ticks:
    """The instants of the last tick and of the next one."""

    def __init__(self) -> None:
        self.next_ns: int | None = None
        """The instant of the next tick; None before the start."""
        self.last_ns = 0
        """The instant up to which bodies have been moved; the caller sets it after each tick."""
        self.count = 0
        """The number of ticks that took place."""
        self.skipped = 0
        """The number of ticks that were left out, because the host woke the world more than a period after them."""

    def begin(self, now_ns: int, *, period_ns: int) -> None:
        """Start to count; the first tick is one period ahead."""
        self.last_ns = now_ns
        self.next_ns = now_ns + period_ns

    def resume(self, now_ns: int, *, tick_ns: int) -> None:
        """Continue after a time in which nothing moved, with a new phase: the next tick is `tick_ns` ahead. It moves
        bodies for the time since the last tick, but for no more than twice `tick_ns`.
        """
        self.last_ns = max(self.last_ns, now_ns - tick_ns)
        self.next_ns = now_ns + tick_ns

    def follow(self, due_ns: int, now_ns: int, *, period_ns: int) -> None:
        """Plan the tick after the one at `due_ns`. If several ticks have been due since, all but the latest of them are
        skipped, so that the phase stays as it was.
        """
        self.count += 1
        self.next_ns = due_ns + period_ns
        behind = (now_ns - self.next_ns) // period_ns
        if behind > 0:
            self.next_ns += behind * period_ns
            self.skipped += behind
