"""Where an experiment that flies actors of its own keeps the records of the run."""

from sim.records.trace_log import TraceLog

__all__ = ["TraceLog"]
