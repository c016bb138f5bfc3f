"""The recordings of a plan, as answers state them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace

from pneucli.figure import named
from pneucli.messages.plan import PlannedRecording, by_hand_text
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import cost_of
from pneucli.plan.simulation import start_of
from pneucli.simulate.model import Model


def planned_recordings(programme: Sequence[Manoeuvre], model: Model) -> Iterator[PlannedRecording]:
    """Yield the planned recordings with their times in ``commands.csv``."""
    begin = 0.0
    for number, m in enumerate(programme, 1):
        yield replace(planned_recording(m, model), name=f"plan_{number}_{m.kind}", begin=begin, end=begin + m.duration)
        begin += cost_of(m)


def planned_recording(m: Manoeuvre, model: Model) -> PlannedRecording:
    """Return one manoeuvre as a recording of a rig that a model describes."""
    bench = m.bench
    return PlannedRecording(
        *(m.use, m.kind, bench.name, bench.experiment, bench.drive, bench.quantity),
        *(bench.template.chamber_2, bench.template.chamber, bench.template.imposed),
        valve="shut" if m.kind == "shut-valve" else None,
        start=asdict(start_of(m, model)),
        gain=bench.gain if bench.drive == "position" else None,
        **named(m, "centre level frequency speed pressure force added_mass"),
        by_hand=by_hand_text(m.kind, m.force, m.added_mass) if m.by_hand else None,
    )
