"""One run of a scenario, in virtual time or as real processes, and what is collected from it.

virtual       one process, no clock: deterministic
launcher      one process for each UAV, the emulator and the world
collecting    what comes back over the bus from processes
bus           router, certificates, rights, running swarms, changes of the air
outcome       what either gives to metrics and files
api, result   the same for programs and notebooks
"""
