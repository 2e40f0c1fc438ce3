"""Everything around the agents and the emulator of fanet-mw: the simulated world, runs, results,
sweeps and commands.
"""
