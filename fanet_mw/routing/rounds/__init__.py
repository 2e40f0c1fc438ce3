"""Flooding in rounds: a turn for every node, known from the number of nodes alone."""
