"""The plan of the next experiment: manoeuvres, steps for a person, what was refused, and what a plan decided."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table, warnings
from pneucli.messages.diagnose import REJECTION_REASONS
from pneucli.messages.formatting import (
    format_interval,
    format_percent,
    format_plain,
    format_quantity,
    join_names,
)

Answer = Mapping[str, Any]

GOOD_POWER = 0.8  # of an effect that the recordings would show

MANOEUVRES = {
    "steps": "steps of {level} and −{level} from the null command",
    "stairs": "stairs up to {level} and down to −{level}",
    "random-steps": "random steps of up to {level} to both sides, each held for 0.05 to 0.6 s",
    "hold": "open with {level} for a moment, then hold at the null command",
    "command-sine": "a sine of {level} at {frequency} at the valve",
    "triangle": "a slow triangle of {level} about the null command",
    "pulses": "short openings of {level} to both sides",
    "motion-sine": "a position sine of {level} about {centre} at {frequency}",
    "strokes": "strokes of {level} about {centre} at {speed}",
    "position-steps": "steps of the position of up to {level}, with rests",
    "starts-after-rests": "slow starts of {level} after rests of 0.2, 1 and 4 s",
    "small-reversals": "reversals of {level} at {frequency}",
    "strokes-at-pressure": "strokes of {level} about {centre} at {speed}, from {pressure} in chamber 2",
    "machine-strokes": "strokes of {level} at {speed} and {pressure}",
    "shut-valve": "shut the ball valve at chamber 1 and hold for 12 s",
    "known-force": "strokes of {level} at {speed} against a known force of {force}",
}
BY_HAND = {
    "shut-valve": "Fill chamber 1 at rest, then shut the ball valve between valve and chamber 1 before the recording "
    "starts; open it afterwards.",
    "known-force": "Hang a weight of {mass} on a rope over a pulley so that it pulls the piston {direction}; remove it "
    "afterwards.",
}
DRIVES = {  # in a few words, and for a person who sets it up
    "valve": ("commands at the valve", "commands at the valve"),
    "position": ("position loop", "a position loop with {gain}, or your own"),
    "motion": ("position followed by the bench", "the bench's own drive follows the position"),
    "machine": ("imposed by the machine", "the machine follows the position at a held pressure"),
}
RUNNING_RULES = (
    "Bring the piston to the first position by hand or with low speed before each recording.",
    "Save each recording as its own file, NAME as in the table, with the same channels as before.",
    "Stop at once when the piston touches an end: send the null command.",
)
QUANTITIES = {
    "x": "position",
    "v": "speed",
    "p1": "pressure of chamber 1",
    "p2": "pressure of chamber 2",
    "force": "net pressure force",
    "air": "air",
}


def manoeuvre_text(recording: Answer) -> str:
    """Return a planned recording as a phrase; its keys are those of the JSON answer."""
    quantity = "V" if recording["drive"] == "valve" else "m"
    return MANOEUVRES[recording["kind"]].format(
        centre=format_quantity(recording["centre"], "m", 3),
        level="" if recording["level"] is None else format_quantity(abs(recording["level"]), quantity, 3),
        frequency=f"{format_plain(recording['frequency'] or 0.0)} Hz",
        speed=format_quantity(recording["speed"], "m/s", 3),
        pressure=format_quantity(recording["pressure"], "Pa", 3),
        force=format_quantity(recording["force"], "N", 3),
    )


def refused_text(one: Answer) -> str:
    """Return why a manoeuvre was refused."""
    quantity, unit = QUANTITIES[one["quantity"]], one["unit"]
    return (
        f"{one['text']}: {quantity} {format_quantity(one['value'], unit, 3)} against the limit "
        f"{format_quantity(one['limit'], unit, 3)} ({one['model']})"
    )


def plan_sentence(answer: Answer) -> str:
    """Return what a plan is for, in one sentence."""
    count = sum(r["use"] == "train" for r in answer["recordings"])
    held_out, seconds = len(answer["recordings"]) - count, f"{answer['seconds']:.0f} s"
    recordings = f"{count} recordings and {held_out} to be held out, {seconds} of machine time"
    found, all_effects = sum(e["power"] >= GOOD_POWER for e in answer["expected"]), len(answer["expected"])
    if answer["first"] or len(answer["rivals"]) == 1:
        question = "" if answer["first"] else "no effect is in question, and "
        return f"{recordings}: {question}{found} of {all_effects} effects would be shown at their typical size (80 %)."
    names = join_names(list(dict.fromkeys(r["effect"] for r in answer["rivals"] if r["effect"] is not None)))
    return f"{recordings}, to decide about {names}: {found} of {all_effects} would be shown if they are true (80 %)."


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield the plan, its expected outcome and the next step; with ``-v`` also refused manoeuvres and powers."""
    if answer["schema"].startswith("pneucli/plan-taken"):
        yield from _taken(answer, file)
        return
    yield from labelled("plan", answer["sentence"])
    rows = [
        (r["name"], r["use"], manoeuvre_text(r), r["bench"], f"{r['end'] - r['begin']:.1f}")
        for r in answer["recordings"]
    ]
    if rows:
        yield from table(("recording", "use", "manoeuvre", "bench", "s"), rows, texts=4)
    for step in answer["manual"]:
        yield from labelled("by hand", f"{step['recording']}: {step['text']}")
    expected = sorted(answer["expected"], key=lambda e: -e["power"])
    found = [f"{e['rival']} {format_percent(e['power'])}" for e in expected[:8]]
    if found:
        yield from labelled("power", f"probability that the recordings show what is true: {join_names(found)}")
    yield from labelled("files", join_names(answer["files"]))
    if answer["recordings"]:
        do = f"record {answer['folder']}/commands.csv as steps.md says, then: pneucli plan {file} --take FILE..."
        yield from labelled("do", do)
    yield from warnings(answer)
    if verbose:
        for one in answer["refused"]:
            yield from labelled("refused", refused_text(one))


def by_hand_text(kind: str, force: float, mass: float) -> str:
    """Return what a person has to do for a manoeuvre; force of the weight in N toward +x, its mass in kg."""
    direction = "away from x = 0" if force > 0.0 else "toward x = 0"
    return BY_HAND[kind].format(mass=format_quantity(mass, "kg", 3), direction=direction)


def steps_page(answer: Answer, file: str) -> str:
    """Return ``steps.md``: what a person does, in order; ``file`` is the pipeline file."""
    parts = [f"# Next experiment for {answer['pipeline']}", "", answer["sentence"], "", "## Before", ""]
    parts += [f"- {rule}" for rule in RUNNING_RULES]
    parts += [f"- {limit}" for limit in limit_texts(answer["limits"])]
    parts += ["", "## Recordings", ""]
    setup = None
    for number, r in enumerate(answer["recordings"], 1):
        if setup != (setup := f"**On the {r['bench']}** ({bench_text(r)}):"):
            parts += [setup, ""] if number == 1 else ["", setup, ""]
        use = "fitted" if r["use"] == "train" else "held out: never fitted"
        parts.append(f"{number}. `{r['name']}` ({r['end'] - r['begin']:.1f} s, {use}): {manoeuvre_text(r)}.")
        parts.append(f"   Start at rest: {start_text(r['start'], r['bench'] == 'cylinder')}.")
        if r["by_hand"]:
            parts.append(f"   By hand: {r['by_hand']}")
        parts.append(
            f"   Commands: `commands.csv` from {r['begin']:.2f} s to {r['end']:.2f} s, column `{r['column']}`."
        )
    parts += ["", "## After", "", "Take the recordings in, in this order:", ""]
    names = " ".join(f"{r['name']}.csv" for r in answer["recordings"])
    parts += [f"    pneucli plan {file} --take {names}", ""]
    return "\n".join(parts)


def start_text(start: Answer, moves: bool = True) -> str:
    """Return where a recording starts: a vessel has one pressure, a cylinder two and a position."""
    names = ("p1", "p2") if moves else ("p1",)
    pressures = [f"{name} near {format_quantity(start[name], 'Pa', 2)} (absolute)" for name in names]
    return f"x = {format_quantity(start['x'], 'm', 3)}, {join_names(pressures)}" if moves else pressures[0]


def bench_text(recording: Answer) -> str:
    """Return how a bench is driven."""
    how = DRIVES[recording["drive"]][1].format(gain=format_quantity((recording["gain"] or 0.0), "V/m", 3))
    state = {"closed": "chamber 2 closed", "open": "chamber 2 open", "valve": "chamber 2 at its valve", None: ""}
    return ", ".join(filter(None, [how, state[recording["chamber_2"]]]))


def by_hand_title(recording: Answer) -> str:
    """Return how a recording is driven, in a few words."""
    return "with a step by hand" if recording["by_hand"] else DRIVES[recording["drive"]][0]


def limit_texts(limits: Answer) -> list[str]:
    """Return the limits that a plan keeps, one sentence each."""
    texts = []
    if limits["position"] is not None:
        low, high = (format_quantity(x, "m", 3) for x in limits["position"])
        texts.append(f"The plan keeps the piston between {low} and {high}.")
    shown = (("max_speed", "m/s", "speed"), ("max_pressure", "Pa", "pressure (absolute)"), ("max_force", "N", "force"))
    texts += [
        f"Highest {title}: {format_quantity(limits[key], unit, 3)}."
        for key, unit, title in shown
        if limits[key] is not None
    ]
    return texts


def _taken(answer: Answer, file: str) -> Iterator[str]:
    before, after = answer["before"], answer["after"]
    yield from labelled("taken", f"{join_names([r['name'] for r in answer['recordings']])} into {file}")
    yield from labelled("found", answer["sentence"])
    rows = [
        (one["effect"], _probability(one["before"]), _probability(one["after"]), _change(one["effect"], before, after))
        for one in answer["effects"]
    ]
    if rows:
        yield from table(("effect", "before", "after", "named"), rows, texts=1)
    for reason in dict.fromkeys(one["reason"] for one in answer["effects"] if one["reason"] in REJECTION_REASONS):
        alike = join_names([one["effect"] for one in answer["effects"] if one["reason"] == reason])
        yield from labelled("refused", f"{alike}. {REJECTION_REASONS[reason]}")
    for one in answer["parameters"]:
        old, new = (_interval(one[when]) for when in ("before", "after"))
        yield from labelled("size", f"{one['name']}: {old} → {new}")
    if before["verdict"] != after["verdict"]:
        yield from labelled("verdict", f"{before['verdict'] or 'no diagnosis'} → {after['verdict']}")


def taken_sentence(before: Answer, after: Answer, decided: Sequence[Answer]) -> str:
    """Return what new recordings decided."""
    new = [one["effect"] for one in decided if one["now"] == "named"]
    gone = [one["effect"] for one in decided if one["now"] == "refused"]
    parts = [f"{join_names(new)} is now named" if len(new) == 1 else f"{join_names(new)} are now named"] if new else []
    parts += [f"{join_names(gone)} is no longer named"] if gone else []
    if parts:
        return "; ".join(parts) + "."
    named = join_names(after["missing"])
    return f"The recordings decide nothing new: {named or 'no effect'} is named as before."


def _probability(value: float | None) -> str:
    return "–" if value is None else format_percent(value)


def _change(effect: str, before: Answer, after: Answer) -> str:
    """Return whether an effect was named, and is now."""
    was, now = (effect in when["missing"] for when in (before, after))
    return {(True, True): "as before", (False, True): "now", (True, False): "no longer", (False, False): ""}[was, now]


def _interval(one: Answer | None) -> str:
    return "not fitted" if one is None else format_interval(one["value"], one["unit"], one["ci95"])
