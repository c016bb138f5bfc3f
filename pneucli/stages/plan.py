"""``plan``: the next experiment, from the last diagnosis or, with ``--first``, from the rig's description alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.config.recording_sources import plugin_files
from pneucli.errors import InputError, require_known
from pneucli.export.command_player import PlayedRecording, PlayerLimits, write_players
from pneucli.figure import to_answer
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model, free_parameters
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import Provenance, Tables, write_text
from pneucli.messages import answer_of, diagnose
from pneucli.messages.formatting import format_plain
from pneucli.messages.plan import (
    GOOD_POWER,
    Answer,
    ExceededLimit,
    Expected,
    ManualStep,
    PlannedRecording,
    Power,
    RefusedManoeuvre,
    RivalAnswer,
)
from pneucli.messages.progress import counted
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects, select_effects
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import digest
from pneucli.plan.bench import LOOP_RANGE_UNKNOWN, Bench, Manoeuvre, described_benches, recorded_benches, sample
from pneucli.plan.first import MODEL_ERROR, extreme_models, sample_residual_models, typical_model, with_typical_spread
from pneucli.plan.limits import BEST_MODEL, Limits, Refused, Safety, limits_of, models_to_check
from pneucli.plan.manoeuvres import (
    CHANGE_OVER_TIME,
    SPEED_SHARE,
    candidate_manoeuvres,
    cost_of,
    draw_programme,
    manual_manoeuvres,
    planned_recording,
    planned_recordings,
)
from pneucli.plan.power import (
    Expectation,
    Prediction,
    deviations_of,
    power_table,
    prior_information,
    with_absent_effects,
)
from pneucli.plan.rivals import Rival, rivals_of_diagnosis
from pneucli.plan.simulation import is_followed
from pneucli.recording import Rig
from pneucli.report.plan_page import plan_page
from pneucli.simulate.model import without_effect
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.pipeline_file import priors_in_model

DEFAULT_MINUTES, FIRST_MINUTES = 3.0, 5.0
MIN_SECONDS = 15.0  # s of machine time: one recording and one that is held out
MAX_SHARE_BY_HAND = 0.5  # of the machine time
MIN_DONE = 0.5  # of the motions of a position loop
SEED_DIGITS = 8  # of the digest


def run(context: Context) -> dict[str, Any]:
    """Plan the next experiment, write its files, and return the answer that ``--json`` prints.

    Raises InputError where the limits leave no manoeuvre, or an effect is unknown.
    """
    first = bool(context.options.get("first"))
    seconds = 60.0 * float(context.options.get("minutes", FIRST_MINUTES if first else DEFAULT_MINUTES))
    if seconds < MIN_SECONDS:
        raise InputError(
            "--minutes", f"{format_plain(seconds / 60.0)}", f"at least {format_plain(MIN_SECONDS / 60.0)}", code="E001"
        )
    basis = described_rig(context) if first else diagnosed_pipeline(context)
    basis = replace(basis, benches=[with_kept_loop(bench, basis.safety) for bench in basis.benches])
    context.progress("drawing a programme")
    programme = _drawn(basis, seconds)
    if not programme and not basis.safety.refused:
        raise InputError("--minutes", f"{format_plain(seconds / 60.0)}", "time for the shortest manoeuvre", code="E001")
    if not programme:
        raise limits_too_narrow(f"{context.path}, key plan", _refusals(basis))
    predictions = _predictions(context, basis, programme)
    if by_hand := _needed_by_hand(basis, _total_information(programme, predictions), seconds):
        programme = _drawn(basis, seconds, by_hand)
        predictions = _predictions(context, basis, programme)
    information = _total_information(programme, predictions)
    context.progress("power of the plan")
    powers = power_table(basis.expectation, information)
    answer = plan_answer(context, basis, programme, predictions, powers, information)
    return to_answer(write_plan(answer, programme, predictions, context, basis))


def with_kept_loop(bench: Bench, safety: Safety) -> Bench:
    """Return a bench whose position loop does half of its motions within the limits: its own, else the gentler one that
    does most: a small actuator on a large valve exceeds its speed at usual gains.
    """
    if bench.drive != "position":
        return bench
    keeps, best = replace(safety, refused=[]), next(iter(safety.models.values()))

    def done(one: Bench) -> float:
        return float(np.mean([keeps(m) and is_followed(m, best) for m in candidate_manoeuvres(one, safety.limits)]))

    if (own := done(bench)) >= MIN_DONE:
        return bench
    count = int(np.log2(LOOP_RANGE_UNKNOWN / bench.loop_range))
    gentler = [replace(bench, loop_range=bench.loop_range * 2.0**k) for k in range(1, count + 1)]
    shares = [own, *map(done, gentler)]
    return [bench, *gentler][int(np.argmax(shares))]


def _drawn(basis: Basis, seconds: float, by_hand: Sequence[Manoeuvre] = ()) -> list[Manoeuvre]:
    listed = [m for bench in basis.benches for m in candidate_manoeuvres(bench, basis.limits)]
    seed = int(basis.digest[:SEED_DIGITS], 16)

    def is_possible(one: Manoeuvre) -> bool:
        return basis.safety(one) and is_followed(one, basis.expectation.model)

    return draw_programme(listed, seconds, is_possible, seed, by_hand)


def _predictions(context: Context, basis: Basis, programme: Sequence[Manoeuvre]) -> list[Prediction]:
    """Return each recording as the best model predicts it."""
    shown, found = [rival.effect for rival in basis.shown_rivals], []
    for number, one in enumerate(programme):
        context.progress(counted(f"simulating {one.kind}", number, len(programme)))
        found.append(basis.expectation.predict(one, shown))
    return found


def _total_information(programme: Sequence[Manoeuvre], predictions: Sequence[Prediction]) -> Array:
    """Return the information of all fitted recordings."""
    return np.asarray(sum(p.information for one, p in zip(programme, predictions, strict=True) if one.use == "train"))


def _needed_by_hand(basis: Basis, information: Array, seconds: float) -> list[Manoeuvre]:
    """Return the manoeuvres by hand that show a rival which the drawn commands would not show.

    An example is a weight on the piston: a motion alone shows a mass only relative to the scale of the pressures.
    """
    power = basis.expectation.power
    weak = [r for r in basis.shown_rivals if power(information, r.effect) < GOOD_POWER]
    listed = [m for bench in basis.benches for m in manual_manoeuvres(bench, basis.limits)] if weak else []
    groups: dict[tuple[object, ...], list[Manoeuvre]] = {}
    for one in filter(basis.safety, listed):
        groups.setdefault((*one.bench.setup, one.kind), []).append(one)
    needed: list[Manoeuvre] = []
    for group in groups.values():
        more = information + sum(basis.expectation.predict(one).information for one in group)
        fits = sum(map(cost_of, [*needed, *group])) <= MAX_SHARE_BY_HAND * seconds
        if fits and any(power(more, r.effect) >= GOOD_POWER for r in weak):
            needed += group
    return needed


COMMAND_PERIOD = 1e-3  # s, between the rows of commands.csv
COMMANDS_FILE, STEPS_FILE, PAGE_FILE = "commands.csv", "steps.md", "plan.html"
COLUMNS = {  # of commands.csv: header, factor from SI, decimals
    "u": ("u [V]", 1.0, 5),
    "u2": ("u2 [V]", 1.0, 5),
    "p_ref": ("p_ref [bar]", 1e-5, 5),
    "x_ref": ("x_ref [mm]", 1e3, 4),
}


def write_plan(
    answer: Answer,
    programme: Sequence[Manoeuvre],
    predictions: Sequence[Prediction],
    context: Context,
    basis: Basis,
) -> Answer:
    """Write the files of a plan; return its answer with their names.

    Args:
        answer: The answer so far.
        programme: The recordings.
        predictions: Each as the best model predicts it.
        context: The run of the stage.
        basis: What the plan started from.
    """
    out, rows = context.out, answer.recordings
    answer = replace(answer, sentence=answer.purpose)
    write_text(out / COMMANDS_FILE, commands_csv(programme, rows))
    write_text(out / STEPS_FILE, answer.steps_page(context.path.name))
    tables = Tables(out, "plan", Provenance({}, {"plan": context.config.document.get("plan", {})}))
    columns = "effect, parameter, size [see column unit], unit, power [1], typical [1]"
    tables.write("power", columns, map(astuple, answer.power))
    write_text(out / PAGE_FILE, plan_page(answer, predictions))
    if targets := {*context.options.get("to", [])} & {"c", "st"}:
        played = [_played(m, row) for m, row in zip(programme, rows, strict=True)]
        write_players(out, targets, played, _player_limits(basis.limits, programme), context.config.name)
    return replace(
        answer,
        files=sorted(path.name for path in out.iterdir() if not path.name.startswith(".")),
        folder=f"{context.artifacts.parent.name}/{context.artifacts.name}/plan",
    )


def commands_csv(programme: Sequence[Manoeuvre], rows: Sequence[PlannedRecording]) -> str:
    """Return ``commands.csv``: a row each millisecond, the columns that the benches take, the recording's name.

    A column is empty where the bench takes another command. Between recordings the last value is held.
    """
    columns = [name for name in COLUMNS if any(name in _commands(m) for m in programme)]
    lines = [",".join(["time [s]", *(COLUMNS[name][0] for name in columns), "recording"])]
    step = 0
    for m, row in zip(programme, rows, strict=True):
        commands = _commands(m)
        length = next(iter(commands.values())).size
        rest = round(CHANGE_OVER_TIME / COMMAND_PERIOD) if row is not rows[-1] else 0
        for k in range(length + rest):
            cells = [f"{(step + k) * COMMAND_PERIOD:.3f}"]
            for name in columns:
                _, factor, decimals = COLUMNS[name]
                value = commands[name][min(k, length - 1)] * factor if name in commands else None
                cells.append("" if value is None else f"{value:.{decimals}f}".rstrip("0").rstrip("."))
            lines.append(",".join([*cells, row.name if k < length else ""]))
        step += length + rest
    return "\n".join(lines) + "\n"


def _commands(manoeuvre: Manoeuvre) -> dict[str, Array]:
    """Return the commands (n,) of a manoeuvre in SI: what its bench takes."""
    bench, values = manoeuvre.bench, sample(manoeuvre.profile, COMMAND_PERIOD)
    found = {bench.quantity: values}
    if bench.drive == "valve" and "u2" in bench.signals:
        found["u2"] = 2.0 * bench.rig.valve_null - values
    if manoeuvre.pressure is not None:
        found["p_ref"] = np.full(values.size, manoeuvre.pressure)
    return found


def _played(manoeuvre: Manoeuvre, row: PlannedRecording) -> PlayedRecording:
    bench = manoeuvre.bench
    return PlayedRecording(
        name=row.name,
        is_position=bench.quantity == "x_ref",
        gain=bench.gain if bench.drive == "position" else 0.0,
        segments=manoeuvre.profile,
        rest=CHANGE_OVER_TIME,
    )


def _player_limits(limits: Limits, programme: Sequence[Manoeuvre]) -> PlayerLimits:
    benches = [m.bench for m in programme]
    low, high = limits.position
    return PlayerLimits(
        null=benches[0].rig.valve_null,
        command=max(limits.command_range(b) for b in benches),
        position=(low, high) if np.isfinite(low) and np.isfinite(high) else None,
        pressure=limits.max_pressure if np.isfinite(limits.max_pressure) else None,
        soft_start=limits.soft_start,
        max_speed=SPEED_SHARE * limits.max_speed if np.isfinite(limits.max_speed) else None,
        mirrored=any("u2" in b.signals for b in benches),
    )


VESSEL_HORIZON, AXIS_HORIZON = 5.0, 0.5  # s between restarts of the comparison, as the pipelines of new rigs have them
NOISE_WARNING = (
    "The powers assume usual sensors, and that the best model leaves five times the noise, correlated over 0.1 s: "
    "after the first recordings, plan again from the diagnosis."
)


@dataclass(frozen=True)
class Basis:
    """What a plan starts from.

    Attributes:
        benches: The benches that can show what is in question.
        safety: The limits of the rig, and the models in which every manoeuvre must keep them.
        expectation: The best model, the models with other effects, and what is known of parameters.
        rivals: The hypotheses in question.
        digest: Digest of what the plan starts from, which seeds the draw.
        warnings: What a reader has to know.
    """

    benches: Sequence[Bench]
    safety: Safety
    expectation: Expectation
    rivals: Sequence[Rival]
    digest: str
    warnings: Sequence[str] = ()

    @property
    def limits(self) -> Limits:
        """The limits of the rig."""
        return self.safety.limits

    @property
    def shown_rivals(self) -> list[Rival]:
        """The rivals that the benches can show."""
        return [rival for rival in self.rivals if rival.effect in self.expectation.others]


MAX_REFUSED = 30  # refused manoeuvres in an answer


def plan_answer(
    context: Context,
    basis: Basis,
    programme: Sequence[Manoeuvre],
    predictions: Sequence[Prediction],
    powers: Sequence[Power],
    information: Array,
) -> Answer:
    """Return the answer without its files."""
    recordings = [
        replace(row, times_noise={name: one.rms for name, one in predicted.differences.items()})
        for row, predicted in zip(planned_recordings(programme, basis.expectation.model), predictions, strict=True)
    ]
    refused = _refusals(basis)
    first = bool(context.options.get("first"))
    best = RivalAnswer(BEST_MODEL, None, True, None, None)
    rivals = [RivalAnswer(r.name, r.effect, r.present, r.probability, r.in_place_of) for r in basis.rivals]
    return Answer(
        schema="pneucli/plan/1",
        pipeline=context.config.name,
        first=first,
        seconds=recordings[-1].end,
        recordings=recordings,
        manual=[ManualStep(r.name, r.by_hand) for r in recordings if r.by_hand],
        limits=_limits(basis.limits),
        refused=refused[:MAX_REFUSED],
        refused_count=len(refused),
        rivals=[] if first else [best, *rivals],
        warnings=basis.warnings,
        expected=_expected(basis, powers, information),
        power=powers,
    )


def _expected(basis: Basis, powers: Sequence[Power], information: Array) -> list[Expected]:
    """Return for each rival its probability before, and the power to show it; without rivals for every effect.

    A rival that no bench of the recordings can show has a power of 0.
    """
    if not basis.rivals:
        return [Expected(p.effect, p.effect, None, p.power) for p in powers if p.typical]
    shown = {r.name: basis.expectation.power(information, r.effect) for r in basis.shown_rivals}
    return [Expected(r.effect, r.name, r.own_probability, shown.get(r.name, 0.0)) for r in basis.rivals]


def _limits(limits: Limits) -> dict[str, Any]:
    """Return the limits, SI; None: not limited."""
    values = asdict(limits) | {"position": list(limits.position)}
    return {name: value if value is not None and np.isfinite(value).all() else None for name, value in values.items()}


def _refusals(basis: Basis) -> list[RefusedManoeuvre]:
    """Return the refused manoeuvres, each with the first limit that it exceeds."""

    def refused(one: Refused) -> RefusedManoeuvre:
        row = planned_recording(one.manoeuvre, basis.expectation.model)
        return RefusedManoeuvre(row.manoeuvre, row.bench, one.model, one.violations[0])

    return list({r.text + r.exceeded.quantity: r for r in map(refused, basis.safety.refused)}.values())


def limits_too_narrow(where: str, refused: Sequence[RefusedManoeuvre]) -> InputError:
    """Return the refusal of a plan for which no manoeuvre is left, with the one that comes nearest to its limit."""

    def excess(one: ExceededLimit) -> float:
        return abs(one.value - one.limit) / max(abs(one.limit), 1e-9)

    nearest = min(refused, key=lambda one: excess(one.exceeded))
    return InputError(
        where,
        f"none of {len(refused)} manoeuvres keeps the limits of the rig; the nearest is {nearest.reason}",
        "limits that one of them keeps",
        "state end_margin, max_speed, max_pressure, max_force or max_air in [plan]",
        code="E071",
    )


def diagnosed_pipeline(context: Context) -> Basis:
    """Return what the last diagnosis leaves open; raises InputError where no recording runs over time."""
    pipeline = PipelineData.for_search(context)
    train = pipeline.residual_models("train")
    if not train:
        raise InputError(
            f"{context.path}, key recordings",
            "no recording over time to plan from",
            "recordings, or --first",
            f"pneucli plan {context.path} --first",
            code="E061",
        )
    wanted = _wanted_effects(context, pipeline.available_effects)
    context.progress("fitting the best model")
    diagnosis = answer_of(diagnose.Answer, context.answers)
    best = _best_fit(pipeline, train, diagnosis.missing)
    present = [e.name for e in best.model.effects]
    rivals = rivals_of_diagnosis(diagnosis, present, wanted)
    absent = with_absent_effects(best.model, pipeline.available_effects.values(), train)
    doubtful = {r.effect: without_effect(best.model, r.effect) for r in rivals if not r.present}
    expectation = Expectation(
        best.model,
        absent | doubtful,
        best.free,
        prior_information(len(absent) + len(doubtful), best.free),
        pipeline.horizon,
        context.config.compare.low_pass,
        deviations_of(train, best.residual),
    ).with_recordings(train)
    benches = recorded_benches([one.experiment for one in train])
    limits = limits_of(pipeline.rig, benches, context.config.plan.model_dump())
    checked = {r.name: expectation.others[r.effect] for r in rivals if r.effect in expectation.others}
    asked = [pipeline.available_effects[r.effect] for r in rivals]
    telling = [m.experiment.recording for m in train if any(m.is_sensitive_to(e) for e in asked)]
    return Basis(
        [b for b in benches if any(map(b.made, telling))] or benches,
        Safety(pipeline.rig, limits, models_to_check(best, checked)),
        expectation,
        rivals,
        diagnosis.data,
    )


def _wanted_effects(context: Context, available: Mapping[str, Effect]) -> list[str]:
    wanted: list[str] = context.options.get("effects", [])
    require_known(wanted, available, "--effects", 'no effect "{}"', "effects of the catalogue", code="E030")
    return wanted


def _best_fit(pipeline: PipelineData, train: Sequence[ResidualModel], missing: Sequence[str]) -> Fit:
    """Return the fit of the model with the effects of the pipeline file and those that the diagnosis names."""
    given, where = pipeline.effects, f"{pipeline.context.path}, key model.effects"
    named = [n for n in missing if n not in {e.name for e in given}]
    added = select_effects(named, pipeline.available_effects, where)
    return with_intervals(fit_model(pipeline.guess(), train, (*given, *added)), train)


def described_rig(context: Context) -> Basis:
    """Return a typical model of a rig that is only described; raises InputError where ``[rig]`` describes no bench."""
    config = context.config
    catalogue = all_effects(plugin_files(config))
    given = select_effects(config.model.effects, catalogue, f"{context.path}, key model.effects")
    rig = replace(_described(context), priors=priors_in_model(config, given, catalogue))
    benches = described_benches(rig, config.plan.max_command)
    limits = limits_of(rig, benches, config.plan.model_dump())
    model = typical_model(
        rig, benches, config.model.valve if rig.valve_kind == "proportional" else rig.valve_kind, given
    )
    horizon = AXIS_HORIZON if rig.has_cylinder else VESSEL_HORIZON
    samples = sample_residual_models(benches, limits, model, horizon)
    free = free_parameters(model, samples)
    absent = with_absent_effects(model, [e for e in catalogue.values() if e.side is None], samples)
    free = with_typical_spread(free)
    return Basis(
        benches,
        Safety(rig, limits, extreme_models(model)),
        Expectation(
            model,
            absent,
            free,
            prior_information(len(absent), free),
            horizon,
            usual=MODEL_ERROR,
        ),
        [],
        digest([config.rig.model_dump(mode="json"), config.plan.model_dump(mode="json")]),
        [NOISE_WARNING],
    )


def _described(context: Context) -> Rig:
    """Return the rig; raises InputError where no bench, no supply or no null command is described."""
    rig = context.config.to_rig()
    if not described_benches(rig):
        raise InputError(
            f"{context.path}, key rig",
            "neither a vessel nor a cylinder with its stroke",
            "[rig.vessel] volume, or [rig.cylinder] piston_area_1 and stroke",
            "describe the rig",
            code="E063",
        )
    if rig.supply_pressure is None:
        raise InputError(
            f"{context.path}, key rig.supply_pressure", "missing", 'such as "7 bar"', "state the supply", code="E063"
        )
    if rig.null_free:
        raise InputError(
            f"{context.path}, key rig.valve.null",
            '"identify", but there is no recording yet',
            "the command at which nothing flows: every command of the programme is about it",
            'such as null = "5 V", half the range of the valve',
            code="E063",
        )
    return rig
