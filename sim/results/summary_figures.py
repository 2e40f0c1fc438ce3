"""What each figure of `summary.json` means, by its key; docs/reference/results.md is generated from it."""

from collections.abc import Mapping
from typing import Final

FIGURES: Final[Mapping[tuple[str, ...], str]] = {
    ("valid", "invalid_because"): "may the result be used; if not, why, with value and limit",
    ("scenario", "seed", "nodes", "duration_s", "mode"): "what was run, and whether in virtual or real time",
    ("notes",): "what in the scenario was guessed or had no effect",
    ("simulated_s", "wall_s", "time_scale"): (
        "swarm seconds that passed; wall seconds; swarm seconds per wall second at last"
    ),
    ("slowed", "paces"): "when the clock changed its pace, and to which; for how many wall seconds it ran at which",
    ("leads", "pauses"): (
        "real time: lead and handover that were chosen, and why; how often and how long the launcher could do nothing"
        " for 50 ms or more"
    ),
    ("epoch_unix_ns",): "the unix time of swarm instant 0",
    ("generated",): "application packets (`traffic.*`) generated between `warmup_s` and `duration_s - drain_s`",
    ("delivered", "repeated"): (
        "first receptions of those packets by the application of a target node; further ones at a target that had the"
        " packet"
    ),
    ("pdr",): (
        "`delivered / (generated x targets)`. Targets: the destination; for `all`, `traffic.targets` or every other "
        "node"
    ),
    ("unknown",): (
        "deliveries of packets that nobody sent, or not at the instant that their header claims; in no other figure"
    ),
    ("delay_ms",): (
        "from the hand-over by the application at the origin to the receipt by that at the target, over all deliveries"
    ),
    ("delay_parts_ms",): (
        "the mean of its parts: `lead` (announced ahead), `queue` (at the origin), `air` (from the first frame's "
        "start to the end of the last one), `handover` (from there to the application)"
    ),
    ("worst_nodes",): "the five nodes that received the smallest share of what was meant for them",
    ("reports", "warnings", "classes", "applications"): (
        "the same figures for survivor reports, warnings of collisions, each of several `[[traffic]]` (those at the "
        "top are of the first), each application of a user"
    ),
    ("messages",): "the fates of what applications of users sent (delivered, refused, expired ...)",
    ("frames",): (
        "the ledger of transmit requests, counted by the nodes and again by the medium: `sent + unasked = delivered +"
        " dropped{reason} + in_flight + unaccounted`. A broadcast is delivered when one station decoded it. `closes`:"
        " `unasked` and `unaccounted` are 0 and the sum holds"
    ),
    ("copies",): (
        "the ledger at receivers, one copy per frame and station in range: `on_air = received + lost{reason} + "
        "in_flight`; the medium `handed` copies to the bus, of which nodes `heard` so many"
    ),
    ("air.pdr", "air.busy"): (
        "from `warmup_s` on: receptions / (frames put on the air x targets in range), so what collisions and noise "
        "took; mean share of time in which a radio is not idle"
    ),
    ("air.mean_retries", "air.attempt_failure", "air.late_acks"): (
        "unicast: retries per frame until it is acknowledged or given up; failed attempts / attempts; acknowledgments"
        " after their timeout (links too long for `radio.coverage_class`)"
    ),
    ("air.throughput_mbps",): "payload bits (UDP payload) delivered per second, each frame once",
    ("lateness",): "transmit requests that reached the medium after their instant, over all requests",
    ("disturbance",): "real time: how the machine disturbed the run, each measure with its [limit](validity.md)",
    ("bound",): (
        "empty unless an origin stated a bound when it accepted a packet. `within_share`: deliveries within it / (all"
        " packets x targets); `violations`: copies that came later, or `never`, at nodes that the origin did not take"
        " to be gone (`bound_excludes`); `stated_share`: packets with a bound / packets; `worst_ms`, "
        "`observed_max_ms`: the largest bound, and the largest delay under one; `classes`: per application"
    ),
    ("likely",): (
        "the same for delays within which a share of a packet's copies arrive: the least `share` stated; "
        "`within_share`; `stated_share`; `worst_ms`"
    ),
    ("reachable",): (
        "deliveries of each built-in application against an ideal flood without collisions, queues and airtimes, over"
        " the links second by second. `share`: pairs of packet and target that it reaches within the packet's "
        "lifetime / all; `pdr`: deliveries / those pairs; `within_share`: the same within their bound. Of `packets` "
        "whose lifetime was over at the end"
    ),
    ("clusters",): (
        "by the links of each second. `torn`: share of clusters whose members are not connected among themselves; "
        "`hops_to_head`: `mean`, `p95`, and `far`, the share of members more than 4 hops from their head; "
        "`role_changes`: a UAV and minute; `sizes`"
    ),
    ("clock",): (
        "empty while clocks are exact. `error_us`: true error of the nodes' swarm time, each second; `bound_us`: the "
        "greatest that a node stated; `beyond_bound`: of `samples`, those whose error was greater than stated; "
        "`synced_after_s`: when the last node had swarm time; `jumps`: seen and taken out; `lost`: how often a node "
        "gave up its time; `without_time`: nodes that have none at the end"
    ),
    ("admission",): (
        "with `traffic.deadline_s`: packets refused at their origin (`refused`), how often a bound met the deadline "
        "and no longer met it (`met`, `lost`), nodes whose bound does not meet it at the end"
    ),
    ("mission.survivors", "mission.collisions"): (
        "how many there are; contacts of UAVs with each other, the ground or obstacles"
    ),
    ("no_fly_entries",): "how often UAVs came into an area of `world.no_fly_m`",
    ("mission.detected", "mission.approached", "mission.reached"): (
        "survivors whose phone at least one UAV heard; towards which one changed course; at which one arrived"
    ),
    ("mission.uavs_approaching", "mission.time_to_approach_s", "mission.localization_error_m"): (
        "UAVs that changed course for a survivor; when each first did; median distance of the estimated from the true"
        " position then"
    ),
    ("mission.confirmed", "mission.time_to_confirm_s", "mission.confirmed_error_m"): (
        "survivors of whom a UAV said that it saw them, within 25 m of the true place; when, ascending; median "
        "distance of the place told from the true one"
    ),
    ("mission.mistaken", "mission.reopened"): (
        "survivors announced elsewhere, and not taken back; confirmations that were taken back"
    ),
    ("mission.persons", "mission.persons_false"): (
        "survivors confirmed rightly or found as persons; finds of persons that are of nobody, or of somebody found "
        "already"
    ),
    ("mission.inside", "mission.inside_error_m"): (
        "survivors said to be inside a building; median distance of that place from the true one"
    ),
    ("mission.wait_s", "mission.located_wait_s"): (
        "time to the right confirmation from the first reception of a survivor's phone, and from when a UAV first "
        "knew the place with a standard deviation of at most 50 m"
    ),
    ("mission.post_knows_s",): "from the right confirmation until the post on the ground learned of it",
    ("mission.coverage", "mission.covered_95_s"): (
        "share of the area, in cells of 25 m, that came within the nominal range of a phone's receiver; when 95 % had"
        " (null: never)"
    ),
    ("mission.photographed",): "share of the area that a camera has shown; null without cameras",
    ("mission.nearest_m",): (
        "how far the nearest other UAV truly was, of each living UAV once a second: `least`, `p1` (1 % were nearer), "
        "`p50`"
    ),
    ("mission.connected", "mission.biconnected"): (
        "share of the time in which all UAVs that search were one component at `radio.range_m`, and would have "
        "remained one after the loss of any one. Not counted are those that fly home, have crashed, or whose radio is"
        " off"
    ),
    ("mission.post_connected",): "the same as `connected` with the post on the ground; null without a post",
    ("mission.cut_vertices", "mission.diameter"): (
        "UAVs whose loss would separate others of them, and the most hops between any two: `p50` over time, and the "
        "`most`"
    ),
    ("separation",): (
        "with `mission.collision_distance_m`. `least_m`: the least true distance of two UAVs; `losses`: how often two"
        " came nearer than that; `foreseen`, `told`: conflicts that a UAV foresaw, or was told of; `ahead_s`: how "
        "long before the closest approach; `warnings`: sent; `reached_the_other`, `to_the_other_ms`: share and delay "
        "of those at the UAV that they are about"
    ),
    ("processes",): (
        "real time: `ready_s`, after which all were up; `ended`: those that ended before the run did, with exit codes"
    ),
    ("aborted",): "why the run ended before its time; null: it did not",
    ("heard", "absent"): (
        "real time: `puts` that the launcher heard and refused (`malformed`, `why`); actors without a valid report, "
        "and why"
    ),
    ("unwritten",): "files, or the recording, that end early or are missing, and why; such a run is not valid",
    ("files", "trace_sha256"): (
        "size and SHA-256 of each file beside the summary, and of the trace; `fanet report` and `fanet replay` read "
        "no others"
    ),
}
