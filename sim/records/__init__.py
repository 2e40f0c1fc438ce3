"""What a run records: the kinds of records and how to read them, the checks on what arrives, and the stores on disk."""
