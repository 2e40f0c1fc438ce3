"""The results of a run: counts, delays, bounds, ledger, validity, files, and a report for people."""
