"""The paper's evaluation, recreated: each figure from a shipped sweep, and a verdict of each claim, by code."""
