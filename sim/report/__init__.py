"""Pages for people: of the paper's evaluation with verdicts, and of a single run."""
