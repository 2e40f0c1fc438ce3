"""Multirotors in full: vehicles with their parameters, rotors, motors, batteries and the control loops on board."""
