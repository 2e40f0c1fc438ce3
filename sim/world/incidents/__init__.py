"""Incidents of a flight, which are counted: contacts, UAVs that come too near to each other,
entries into no-fly areas.
"""
