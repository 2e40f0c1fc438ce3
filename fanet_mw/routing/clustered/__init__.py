"""The clustered flooding protocol of the paper, and the variants that extend it (`routing.protocol = "clustered"`).

`build` chooses the parts of a variant by `clusters.relay`, `contract` says what each part promises, and `clustered`
hands them what happens at a node:

    roles         who leads the swarm and who heads a cluster; failures of both
    clustering    the methods that divide nodes into clusters
    forwarding    a packet's way to the head, its flood, and the repair of lost packets
    relaying      who passes a flood on in contention
    links         what a node knows of links and loads
    tdma, slots   turns, slots of heads, and the queues that are emptied in them
    timetable     `clusters.relay = "scheduled"`: floods that never collide, with delay bounds
"""
