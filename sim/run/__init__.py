"""One run of a scenario, in virtual time or as real processes, and the collection of its results.

virtual       a run in virtual time: one process, deterministic
launcher      a run in real time: one process for each UAV, the emulator and the world
collecting    receives and stores what the processes send over the bus
router        the bus and the clock for services that are started one by one
api           runs for programs and notebooks
"""
