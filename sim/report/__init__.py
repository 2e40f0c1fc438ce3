"""HTML pages for people: one of the paper's evaluation with verdicts, and one of a single run."""
