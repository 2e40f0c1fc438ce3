"""Timetables of collision-free floods: computed from positions or from measured links, followed by every node.

computed     `timetabling` (when), `turn_size` and `turn_allocation` (how many turns), `list_scheduling` and
             `redundant_scheduling` (who sends in which), `interference` (who disturbs whom); the result is a
             `timetable`
followed     `node_timetable`; `turn_access` sends in the turns: own packets and frames to
             neighbors alone from the queues of `turn_release`, where each class has room of its own, relays by
             `scheduled_relaying`
promised     `stated_delays` by `own_bound` (likely delays from `delivery_odds`), `admission`
"""
