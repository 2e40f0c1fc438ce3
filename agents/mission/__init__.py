"""Search and rescue on board one UAV, sans-IO.

    applications        the two searches as applications of a node
    formation_flight    formation flight by clusters, which is no search and uses flight and navigation
    paper_rule          the paper's rule: a UAV flies to a survivor that enough different nodes have reported
    searcher            the planned search: it wires the parts below together

    flight              what velocity to fly: goals, collision avoidance, coherence, the way home
    tasking             which UAV goes to which survivor: an auction, bids, the approach
    search_formation    which UAV takes which place of the search pattern
    finding             which phones were received where, who carries them, and who is confirmed
    navigation          where a UAV is, the map that it carries, and the ways around obstacles

A folder imports from those below it only.
"""
