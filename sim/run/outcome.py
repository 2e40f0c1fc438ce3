"""What an experiment makes of the records and reports of a run that it flew with actors of its own."""

from sim.results.outcome import Outcome

__all__ = ["Outcome"]
