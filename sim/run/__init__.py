"""One run of a scenario, in virtual time or as real processes, and the collection of its results.

virtual       a run in virtual time: one process, deterministic
launcher      a run in real time: one process for each UAV, the emulator and the world
collecting    receives and stores what the processes send over the bus
bus           router, certificates, rights, running swarms, changes of the air
outcome       the common result of both kinds of run, for metrics and files
api, result   runs for programs and notebooks
"""
