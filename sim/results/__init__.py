"""What a run is worth: counts, delays, bounds, ledger, verdict, files and the report for people."""
