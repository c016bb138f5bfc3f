"""What a stage has to tell a person beside its figures: a code, and the values that its sentence needs."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from pneucli.messages.formatting import at_command, fill_in, format_interval

LITRES_PER_MINUTE = 6e4 / 1.185  # l/min ANR in kg/s
Template = str | Callable[..., str]


class Finding(NamedTuple):
    """Something to tell a person: its ``code``, and the ``values`` (SI) and names of its sentence.

    >>> Finding("force-offset", {"force": 3.21}).text[:42]
    'a constant force of 3.21 N acts in additio'
    """

    code: str
    values: Mapping[str, Any] = {}

    @property
    def text(self) -> str:
        """The sentence; what is told of a valve starts with the code."""
        template = VALVE.get(self.code) or OTHERS[self.code]
        said = fill_in(template, **self.values) if isinstance(template, str) else template(**self.values)
        return f"{self.code}: {said}" if self.code in VALVE else said


def tell(code: str, **values: Any) -> str:
    """Return the sentence of a finding."""
    return Finding(code, values).text


def _misfit(ratio: float, unmodelled: tuple[str, ...], better: list[str]) -> str:
    noise = fill_in("model A leaves {ratio:.1f} times the sensors' noise of these forces", ratio=ratio)
    if not unmodelled:
        return (
            f"{noise}: neither A, a function of velocity alone, nor the pipeline's effects describe it; if D, E or F "
            "leave less, friction differs between acceleration and deceleration; else run pneucli diagnose"
        )
    others = f"{' and '.join(better)} can represent more of it" if better else "none of A to F can"
    effects = ", ".join(unmodelled)
    return f"{noise}: A, a function of velocity alone, cannot represent {effects} of the pipeline's model; {others}"


def _pressure_loop(offset: float, gain: float, droop: float, **values: float) -> str:
    return fill_in(
        "p1 follows the command (correlation {correlation:3#}; {spread:2 Pa} rms at each) while the flow varies by "
        "{varied:%}: the valve controls its outlet pressure to {offset:3 Pa} + {gain:3 Pa}/V · u, less {falls:2 Pa} "
        "for 1000 l/min ANR, as one with a pressure loop or a regulator does; its command does not set an area, and C, "
        "b and m do not describe it",
        **values,
        offset=offset,
        gain=gain,
        falls=1000.0 * droop / LITRES_PER_MINUTE,
    )


def _scatters(u: float | None, low: float, high: float, **values: float) -> str:
    return fill_in(
        "{where} the flow differs by {share:%} rms from any function of the two pressures (such as {low:3#} l/min ANR "
        "and {high:3#} l/min ANR near a pressure ratio of {ratio:2#}): something besides command and pressures sets it",
        **values,
        where=at_command(u),
        low=LITRES_PER_MINUTE * low,
        high=LITRES_PER_MINUTE * high,
    )


def _cracking(u: float | None, pressure: tuple[float, float, float], count: int, paths: int) -> str:
    value, *ends = map(float, pressure)
    where = "" if paths == 1 else f" at {count} of {paths} openings, {at_command(u).removeprefix('at ')} the most"
    opens = format_interval(value, "Pa", ends)
    return f"nothing flows below a pressure difference of {opens}{where}: a check or a relief valve opens there"


VALVE: Mapping[str, Template] = {
    "valve-not-described": (
        "the map of the valve reaches {largest:4 Pa/s}, its curves show no more than {measured:4 Pa/s}; do not use it, "
        "and see what ingest finds implausible"
    ),
    "valve-curves-not-followed": (
        "the model leaves {residual:noise} × noise on the curves of the valve: an effect is missing, of valve, gas or "
        "supply, or of the axis that shared the fit; or the vessel is full within some samples"
    ),
    "valve-not-foreseen": (
        "the model leaves {residual:noise} × noise on held-out curves; take commands between the fitted ones, or "
        "record more of them"
    ),
    "valve-lack-of-fit": (
        "the model's valve is off the measured gradients by {median:%} in the median, {p95:%} at the 95th "
        "percentile, outside both 95 % intervals at {outside:%} of the points: pneucli diagnose says what it may lack"
    ),
    "flow-uphill": (
        "in {rows} of {of} rows gas flows toward the higher pressure, as a pump or a compressor makes it: no area "
        "describes that; check whether p_supply and p1 are exchanged"
    ),
    "pressure-loop": _pressure_loop,
    "flow-hysteresis": (
        "a command that is reached from above lets through another flow than from below, by {share:%}: hysteresis of "
        "the valve, about ± {half_width:2#} V"
    ),
    "flow-scatters": _scatters,
    "command-idle": (
        "the conductance is the same at {count} commands, within {spread:%}: the command does not set an area; check "
        "the column of u, or whether the component is a fixed orifice"
    ),
    "flow-against-pressure": (
        "{u:command} the flow stays as large while the pressure difference vanishes, as that of a pump does: no area "
        "describes that"
    ),
    "flow-at-no-difference": (
        "{u:command} {share:%} of the largest flow remains without a pressure difference: the zero of the flow meter, "
        "a zero of a pressure gauge, or a second way for the gas; record a row with the valve closed"
    ),
    "curve-not-followed": (
        "{u:command} the curve has another shape than ISO 6358 gives it: {share:%} rms, {ratio:2#} × the scatter of "
        "neighbouring rows; the opening goes with the pressures, as that of a relief or a check valve does, or several "
        "restrictions act in series"
    ),
    "cracking-pressure": _cracking,
}
OTHERS: Mapping[str, Template] = {
    # of friction
    "one-direction": "motion in one direction only: a constant force cannot be distinguished from dry friction",
    "mass-not-identifiable": (
        "these recordings do not identify the moving mass: inertia is neglected, a22 is that of 1 kg"
    ),
    "dry-friction-not-significant": "dry friction is not significantly above zero",
    "static-friction-uncertain": (
        "the Stribeck velocity lies near the end of the measured velocities: static friction is uncertain"
    ),
    "models-missing": ("no model {models}: too few moving samples ({accelerating} accelerating, {slowing} slowing)"),
    "force-offset": (
        "a constant force of {force:3 N} acts in addition to friction (or friction differs by direction, or a sensor "
        "or an area is wrong)"
    ),
    "misfit": _misfit,
    "levels-differ": (
        "kinetic friction differs between recordings ({lowest:3#} to {highest:3 N}): model A pools them; see the level "
        "of each"
    ),
    "no-friction-models": "no friction models: {where}: {found}",
    # of identify
    "vessel-volume": (
        "the recorded flow gives the vessel {value:.4g} cm^3 [{low:.4g}, {high:.4g}], the pipeline file {stated:.4g} "
        "cm^3: check the volume, and the flow's unit and reference conditions"
    ),
    "at-stated-bound": (
        "{name} stands at its bound, which [model.parameters] may set: these recordings ask for more, or do not show it"
    ),
    "at-default-bound": (
        "{name} stands at its bound: these recordings do not show it; leave it out, or record a motion that does"
    ),
    "prior-not-identified": "[model.parameters] {name} is not used: these recordings do not show it",
    "prior-of-absent-effect": "[model.parameters] {name} is not used: the model has not that effect",
    "valve-null-drifts": (
        "valve-null-drifts: {low[0]} ({low[1]:.4g} to {low[2]:.4g} V) and {high[0]} ({high[1]:.4g} to {high[2]:.4g} V) "
        "have no null command in common; the model has one, {null:.4g} V: split the recordings, or find out what moved "
        "the spool"
    ),
    "scattered-position": (
        "{name}: x scatters by {ratio:.2g} times the noise of its sensor, and is smoothed accordingly: record it with "
        "more digits, on a finer scale or at a higher rate, or state its noise in [signals] x"
    ),
    "fit-subsampled": "{used} of {samples} samples are fitted: evenly spaced segments of the longest recordings",
    "no-map": "no valve map: {where}: {found}",
    "effects-idle": (
        "[model] effects {names}: they do not act on a steady bench, which has neither time nor a cylinder"
    ),
    # of diagnose
    "cross-validated": 'no recording has use = "test": each is held out in turn, from a model fitted without it',
    "no-held-out": "no recording is held out: the findings rest on the fitted recordings alone",
    "diagnosis-subsampled": (
        "{used} of {samples} samples are diagnosed: evenly spaced segments of the longest recordings"
    ),
    "pressure-inferred": (
        "{recordings}: {pressures} not recorded and inferred from the model; an initial value can hide a force like "
        "that of a spring"
    ),
    "no-pressure": (
        "{recordings}: no effect is named from motion alone, since an error of the valve's flow passes for a force; "
        "record p1"
    ),
    "p2-missing": (
        "{recordings}: chamber 2 is shut or driven and p2 was not recorded: the forces on the piston cannot be "
        "distinguished; record p2"
    ),
    "switching-design": (
        "the valve is open or shut and has none of the areas that a law asks for: its command would have to be pulses, "
        "which are not designed. The loops count dead times of up to {longest:2 s}, {between:2 s} of it unpredicted"
    ),
    "no-area-design": (
        "the laws ask the valve for an area, which its command does not set ({effects}): what the design says of its "
        "loops does not hold on this rig"
    ),
    "within-uncertainty": (
        "{channel} of recordings that were not fitted errs by {ratio:.2g} times its noise, no more than the "
        "uncertainty of the fitted parameters allows (95 %): record such commands or speeds for the fit, too"
    ),
    "flow-function-of-simulations": (
        "the errors here are those of the flow function that simulations have (b = 0.528 and m = 0.5 unless an effect "
        "changes it); identify and compare use C, b and m of each opening"
    ),
}
