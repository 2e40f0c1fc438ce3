"""The paper's evaluation, recreated: figures from shipped sweeps, and verdicts on claims, both by code."""
