"""Prints a summary for a person: what was requested, what the network did, and what the mission achieved."""

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from sim.results.bounds import broken


def show(summary: Mapping[str, Any], console: Console) -> None:
    mode = "virtual time" if summary["mode"] == "virtual" else "real processes"
    mode += clock_sentence(summary)
    pace = summary["simulated_s"] / summary["wall_s"] if summary["wall_s"] else 0.0
    length = f"{summary['duration_s']:g} s"
    if summary["simulated_s"] < round(summary["duration_s"], 3):
        length = f"partial, {summary['simulated_s']:g} of {length}"
    heading = Text.assemble(
        ("\n" + summary["scenario"], "bold"),
        f", {summary['nodes']} nodes, seed {summary['seed']}, {mode}: {length} in {summary['wall_s']:.1f} s "
        f"({pace:.1f} x real time)",
    )
    heading.highlight_words(["partial"], "bold red")
    console.print(heading)
    table = Table(show_header=False, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(style="bold")
    table.add_column()
    for name, text in _rows(summary):
        table.add_row(name, Text(text))
    console.print(table)
    for warning in _warnings(summary):
        console.print(Text(warning, style="bold red"))


def clock_sentence(summary: Mapping[str, Any]) -> str:
    """At which pace the swarm's clock ran, unless it was real time throughout."""
    paces = summary["paces"]
    if not paces or (len(paces) == 1 and paces[0]["time_scale"] == 1):
        return ""
    full, slower = paces[0], paces[1:]
    text = f", swarm clock at {full['time_scale']:.3g}"
    if not slower:
        return text
    slow_s = sum(pace["wall_s"] for pace in slower)
    return f"{text} for {full['wall_s']:.0f} s, slower for {slow_s:.0f} s (at least {slower[-1]['time_scale']:.3g})"


def _rows(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield from _network_rows(summary)
    mission = summary["mission"]
    if mission["survivors"]:
        yield from _mission_rows(mission)
    elif mission["collisions"]:
        yield "collisions", str(mission["collisions"])
    if summary["no_fly_entries"]:
        yield "no-fly areas", f"entered {summary['no_fly_entries']} times"
    yield from _separation_rows(summary["separation"])
    yield "trace", summary["trace_sha256"][:16]


def _network_rows(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "traffic", _traffic(summary)
    if summary["reports"]["generated"]:
        yield "survivor reports", _traffic(summary["reports"])
    if summary["warnings"]["generated"]:
        yield "warnings", _traffic(summary["warnings"])
    worst = summary.get("worst_nodes") or []
    if worst and worst[0]["pdr"] < 0.999:
        yield "worst receivers", ", ".join(f"node {item['node']} {item['pdr']:.1%}" for item in worst[:3])
    air = summary["air"]
    if air:
        pdr = "-" if air["pdr"] is None else f"{air['pdr']:.1%}"
        yield "air", f"{pdr} of copies received, busy {air['busy']:.1%}, {air['throughput_mbps']:.3f} Mb/s"
    frames = summary["frames"]
    drops = ", ".join(f"{reason} {count}" for reason, count in frames["dropped"].items()) or "none"
    balance = (
        "closes"
        if frames["closes"]
        else f"DOES NOT CLOSE: {frames['unaccounted']} unaccounted for, {frames['unasked']} that nobody asked for"
    )
    yield (
        "frames",
        f"{frames['sent']} sent = {frames['delivered']} delivered + {sum(frames['dropped'].values())} dropped "
        f"+ {frames['in_flight']} in flight ({balance}; drops: {drops})",
    )
    bound = summary["bound"]
    if bound:
        times = broken(bound)
        kept = f"broken {times} times" if times else "never broken"
        kept += f", overtaken by a fault {bound['overtaken']} times" if bound.get("overtaken") else ""
        share = "-" if bound["within_share"] is None else f"{bound['within_share']:.2%}"
        yield (
            "bound",
            f"{share} of packets x targets within it; at most {bound['worst_ms']:.0f} ms, stated for "
            f"{bound['stated_share']:.1%} of the packets; worst seen {bound['observed_max_ms']:.0f} ms, {kept}",
        )
    missed = {name: part for name, part in summary["reachable"].items() if part["share"] is not None}
    if any(part["share"] < 1 for part in missed.values()):
        told = (
            f"{part['pdr']:.2%} of {part['share']:.1%} in reach ({name})" if part["share"] else f"nobody ({name})"
            for name, part in missed.items()
        )
        yield "reachable", ", ".join(told)
    stated = summary["likely"]
    if stated:
        share = "-" if stated["within_share"] is None else f"{stated['within_share']:.2%}"
        yield (
            "likely",
            f"{share} of the copies within what was stated for {stated['share']:.0%} of them: "
            f"at most {stated['worst_ms']:.0f} ms, for {stated['stated_share']:.1%} of the packets",
        )
    yield from _clock_rows(summary["clock"])
    admission = summary["admission"]
    if admission:
        yield (
            "deadline",
            f"{admission['deadline_ms']:.0f} ms: {admission['refused']} packets refused; the bounds of "
            f"{admission['nodes_without']} nodes do not meet it (lost {admission['lost']} times)",
        )
    late = summary["lateness"]
    if summary["mode"] == "realtime":
        yield (
            "lateness",
            f"{late['late_frames']} of {late['frames']} frames late ({late['share']:.2%}, limit {late['limit']:.1%}), "
            f"worst {late['max_ms']:.1f} ms",
        )
    pauses = summary["pauses"]
    if pauses and pauses["count"]:
        yield (
            "pauses",
            f"{pauses['count']} times this machine stood still for a while: {pauses['longest_ms']:.0f} ms at most, "
            f"{pauses['total_ms']:.0f} ms together",
        )


def _clock_rows(clock: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    error = clock.get("error_us", {})
    if error.get("p50") is None:
        return
    stated = ""
    if clock["bound_us"] is not None:
        stated = f", stated at most {clock['bound_us']:.1f} us, exceeded {clock['beyond_bound']} times"
    if clock["jumps"]:
        stated += f"; {clock['jumps']} jumps of clocks seen and taken out"
    if clock["without_time"]:
        stated += f"; {clock['without_time']} nodes have no swarm time at the end"
    yield "clocks", f"off by p50 {error['p50']:.1f} us, p99 {error['p99']:.1f} us, max {error['max']:.1f} us{stated}"


def _traffic(part: Mapping[str, Any]) -> str:
    pdr = "-" if part["pdr"] is None else f"{part['pdr']:.1%}"
    delay = part["delay_ms"]
    times = (
        ""
        if delay["p50"] is None
        else (f", delay p50 {delay['p50']:.0f} ms, p95 {delay['p95']:.0f} ms, max {delay['max']:.0f} ms")
    )
    repeated = f", {part['repeated']} more repeated after a restart" if part["repeated"] else ""
    unknown = f", {part['unknown']} of packets that nobody sent" if part["unknown"] else ""
    return f"{pdr} delivered ({part['generated']} packets, {part['delivered']} deliveries{repeated}{unknown}){times}"


def _mission_rows(mission: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield (
        "survivors",
        f"{mission['detected']} of {mission['survivors']} detected, {mission['approached']} approached, "
        f"{mission['reached']} reached",
    )
    if mission["confirmed"]:
        last_s, error_m = mission["time_to_confirm_s"][-1], mission["confirmed_error_m"]
        yield "confirmed", f"{mission['confirmed']}, the last after {last_s:.0f} s, median error {error_m:.1f} m"
    if mission["persons"] > mission["confirmed"] or mission["persons_false"]:
        without = mission["persons"] - mission["confirmed"]
        yield "persons", f"{without} more whose phone has no name, {mission['persons_false']} finds of nobody else"
    if mission["inside"]:
        yield "inside", f"{mission['inside']} in buildings, median error {mission['inside_error_m']:.0f} m"
    if mission.get("among"):
        yield "among", f"{mission['among']} each one of several people, median error {mission['among_error_m']:.0f} m"
    if mission["wait_s"]["p50"] is not None:
        wait, since = mission["wait_s"], mission.get("located_wait_s", {"p50": None})
        placed = "" if since["p50"] is None else f"; once located: {since['p50']:.0f} s, {since['max']:.0f} s"
        yield "waited", f"from heard to found: median {wait['p50']:.0f} s, longest {wait['max']:.0f} s{placed}"
    if mission["post_knows_s"]["count"]:
        knows = mission["post_knows_s"]
        yield (
            "post",
            f"knows of {knows['count']} of {mission['confirmed']}, median {knows['p50']:.1f} s after the confirmation, "
            f"longest {knows['max']:.1f} s; connected with all {mission['post_connected']:.1%} of the time",
        )
    if mission["mistaken"] or mission["reopened"]:
        yield "mistaken", f"{mission['mistaken']} taken for somebody else, {mission['reopened']} taken back"
    if mission["coverage"] is not None:
        images = (
            f" by phones, {mission['photographed']:.1%} by cameras" if mission.get("photographed") is not None else ""
        )
        share, by_distance = mission["connected"], mission.get("connected_by_distance", mission["connected"])
        faulty = f", {share:.1%} with partitions and jammed areas" if share < by_distance else ""
        yield (
            "search",
            f"{mission['coverage']:.1%} of the area covered{images}, connected by distance {by_distance:.1%} of the "
            f"time{faulty}",
        )
    times = mission["time_to_approach_s"]
    if times:
        middle = times[len(times) // 2]
        yield "approach", f"{len(times)} UAVs, first after {times[0]:.1f} s, half after {middle:.1f} s"
    if mission["localization_error_m"] is not None:
        yield "localization", f"median error {mission['localization_error_m']:.0f} m"
    yield "collisions", str(mission["collisions"])


def _separation_rows(separation: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if not separation or separation["least_m"] is None:
        return
    yield "separation", f"least {separation['least_m']:.1f} m, lost {separation['losses']} times"
    if separation["foreseen"]:
        yield (
            "conflicts",
            f"foreseen {separation['foreseen']} times, {separation['told']} of them by the other UAV alone",
        )


def _warnings(summary: Mapping[str, Any]) -> Iterator[str]:
    heard = summary["heard"]
    if heard and heard["malformed"]:
        what = ", ".join(f"{why} {count}" for why, count in heard["why"].items())
        yield f"Heard on the bus and refused: {what}"
    if late := summary["air"].get("late_acks"):
        yield (
            f"{late:,} acknowledgments came after the timeout: some links are longer than radio.coverage_class allows "
            "for (3 km, or 1.35 km with short slots; 450 m more per class)"
        )
    for reason in summary["invalid_because"]:
        yield f"NOT VALID: {reason}"
    disturbed = any(item["value"] > item["limit"] for item in summary["disturbance"].values())
    if disturbed and not summary["processes"]["ended"]:  # what came late or was lost may be the dead process's
        slower = summary["paces"][1:]
        advice = "let the swarm's clock slow down: fanet launch --slow-down-to 0.1"
        if slower:  # it came too late for the first frames
            advice = f"let the swarm's clock begin slower: fanet launch --set time_scale={slower[-1]['time_scale']:.2g}"
        yield f"This machine could not hold real time. Lower the load, raise radio.lead_ms, or {advice}"
