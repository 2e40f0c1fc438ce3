"""Detailed multirotors: vehicles with their parameters, rotors, motors, batteries and flight control loops."""
