"""Units as laboratories write them; pint is the independent witness."""

import math

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from pneucli.config.value_types import Frequency
from pneucli.errors import UnitError
from pneucli.units import factor_and_offset, parse_quantity, parse_scaled_unit, parse_unit, same_dimension

WITNESS = pint.UnitRegistry()


@pytest.mark.parametrize(
    ("unit", "pint_unit"),
    [
        ("m/s2", "m/s**2"),
        ("m s⁻²", "m/s**2"),
        ("mm2", "mm**2"),
        ("cm^3", "cm**3"),
        ("l/min", "liter/minute"),
        ("psi", "psi"),
        ("hPa", "hPa"),
        ("J/(kg K)", "J/(kg*K)"),
        ("kg/(s Pa)", "kg/(s*Pa)"),
        ("N s/m", "N*s/m"),
        ("1/bar", "1/bar"),
        ("W/K", "W/K"),
        ("kHz", "kHz"),
        ("µm", "um"),
        ("lbf", "lbf"),
        ("mmHg", "mmHg"),
        ("ft", "ft"),
    ],
)
def test_factors_agree_with_pint(unit: str, pint_unit: str) -> None:
    witness = WITNESS.Quantity(1.0, pint_unit).to_base_units().magnitude
    assert factor_and_offset(unit) == (pytest.approx(witness, rel=1e-9), 0.0)


@pytest.mark.parametrize("unit", ["degC", "°C", "℃"])
def test_celsius_has_its_zero_at_273_15_kelvin(unit: str) -> None:
    assert parse_quantity(f"20 {unit}", "K") == pytest.approx(293.15)
    assert parse_quantity(f"0.1 {unit}", "K", difference=True) == pytest.approx(0.1)


@pytest.mark.parametrize("unit", ["barg", "bar(g)", "bar (g)", "bar_g", "barü", "bar gauge"])
def test_gauge_units_stand_on_ambient_pressure(unit: str) -> None:
    assert parse_unit(unit).gauge
    assert parse_quantity(f"6 {unit}", "Pa", ambient_pressure=98_000.0) == pytest.approx(698_000.0)


@pytest.mark.parametrize("unit", ["bara", "bar(a)", "bar abs"])
def test_absolute_units_do_not(unit: str) -> None:
    assert parse_quantity(f"6 {unit}", "Pa", ambient_pressure=98_000.0) == pytest.approx(600_000.0)


@given(st.floats(-1e9, 1e9))
def test_a_bare_number_is_si(number: float) -> None:
    assert parse_quantity(number, "Pa") == number
    assert parse_quantity(repr(number), "1") == number


@pytest.mark.parametrize("unit", ["m", "Pa", "V", "s", "m^2", "K"])
def test_a_text_without_its_unit_is_refused(unit: str) -> None:
    with pytest.raises(UnitError, match=f'"250" has no unit; wanted a quantity such as "1 {unit}"'.replace("^", ".")):
        parse_quantity("250", unit)


@given(st.floats(-1e6, 1e6), st.sampled_from(["bar", "kPa", "psi", "mbar"]))
def test_text_with_unit_scales(number: float, unit: str) -> None:
    assert parse_quantity(f"{number!r} {unit}", "Pa") == pytest.approx(number * factor_and_offset(unit)[0], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("7 baar", 'did you mean "bar"'),
        ("7 bra", 'did you mean "bar"'),
        ("7 Vlt", 'did you mean "volt"'),
        ("7 kg", "dimension of Pa"),
        ("7,5 bar", "decimal comma"),
        ("bar", "not a quantity"),
        ("7 bar)", "bracket"),
        ("7 (bar", "bracket"),
        ("7 bar//s", "operator"),
        ("7 bar/", "incomplete"),
        (True, "not a quantity"),
        (math.inf, "not finite"),
    ],
)
def test_what_cannot_be_read_says_why(text: object, says: str) -> None:
    with pytest.raises(UnitError) as error:
        parse_quantity(text, "Pa")  # type: ignore[arg-type]
    assert says in str(error.value)


def test_dimensions_are_compared_not_names() -> None:
    assert same_dimension("N/m^2", "bar")
    assert not same_dimension("N", "bar")


def test_g_is_gravity_where_an_acceleration_is_wanted_and_a_gram_elsewhere() -> None:
    assert parse_quantity("2 g", "m/s^2") == pytest.approx(2 * 9.80665)
    assert parse_quantity("2 mg", "m/s^2") == pytest.approx(2e-3 * 9.80665)
    assert parse_quantity("2 g", "kg") == pytest.approx(2e-3)
    assert same_dimension("g", "m/s^2")
    assert not same_dimension("g", "m/s")


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("1 rev", "rad", 2 * math.pi),
        ("180 °", "rad", math.pi),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("2 kNm", "N m", 2000.0),
        ("3 cm^3/deg", "m^3/rad", 3e-6 * 180 / math.pi),
    ],
)
def test_units_of_a_rotary_axis(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value)


@pytest.mark.parametrize(
    ("unit", "density"),
    [("l/min ANR", 1.185), ("l/min (ANR)", 1.185), ("Nl/min", 1.2929), ("NL/min", 1.2929), ("Nm3/min", 1292.9)],
)
def test_a_flow_of_air_as_a_volume_is_a_mass(unit: str, density: float) -> None:
    assert parse_quantity(f"600 {unit}", "kg/s") == pytest.approx(600e-3 / 60 * density)
    assert parse_unit(unit).state is not None
    assert parse_unit("kg/s").state is None


VOLUMES = {"l": 1e-3, "L": 1e-3, "ml": 1e-6, "m3": 1.0, "m^3": 1.0, "cm3": 1e-6}
FORMS = {  # how makers of flow meters write volumes in a reference state
    1.2929: (
        "N{v}/{t}",
        "n{v}/{t}",
        "N {v}/{t}",
        "norm {v}/{t}",
        "Norm-{v}/{t}",
        "{v}n/{t}",
        "{v}_n/{t}",
        "{v}(n)/{t}",
    ),
    1.185: ("{v}/{t} ANR", "{v}/{t}(ANR)"),
}


@given(st.sampled_from(sorted(VOLUMES)), st.sampled_from([("min", 60.0), ("h", 3600.0), ("s", 1.0)]), st.data())
def test_volumes_of_air_are_read_in_every_form_and_never_as_nanolitres(
    volume: str, time: tuple[str, float], data: st.DataObject
) -> None:
    density = data.draw(st.sampled_from(sorted(FORMS)))
    text = data.draw(st.sampled_from(FORMS[density])).format(v=volume, t=time[0])
    unit = parse_unit(text)
    assert unit.factor == pytest.approx(density * VOLUMES[volume] / time[1], rel=1e-12), text
    assert unit.state is not None


@pytest.mark.parametrize(
    ("text", "per_minute"),
    [
        *((one, 1.2929e-3) for one in ("NLPM", "nlpm", "slpm", "SLPM", "SLM", "sl/min", "std l/min", "l/min (n)")),
        *((one, 1.2929e-6) for one in ("sccm", "Scm3/min", "mln/min")),
        *((one, 1.2255 / 60) for one in ("Sm3/h", "scmh")),
        *((one, 1.189 * 0.3048**3) for one in ("scfm", "SCFM", "Sft3/min")),
    ],
)
def test_standard_volumes_say_what_else_their_spelling_means(text: str, per_minute: float) -> None:
    assert 60 * parse_unit(text).factor == pytest.approx(per_minute, rel=1e-9)
    state = parse_unit(text).state
    assert state is not None
    assert bool(state.others) == (text[0] in "sS")


@pytest.mark.parametrize(
    "text", ["Nm", "N m", "N/mm", "N s/m", "nm", "ns", "mm/s", "l/min", "cfm", "lpm", "m/s", "Nm/s"]
)
def test_forces_torques_and_plain_flows_have_no_reference_state(text: str) -> None:
    assert parse_unit(text).state is None


def test_only_volumes_have_a_standard_state() -> None:
    with pytest.raises(UnitError, match="no volume"):
        parse_unit("kg/s ANR")


@pytest.mark.parametrize(
    ("spelling", "unit"),
    [
        *((one, "psi") for one in ("Psi", "PSI")),
        *((one, "kPa") for one in ("KPa", "kpa", "KPA", "kilopascals")),
        *((one, "bar") for one in ("Bar", "BAR")),
        *((one, "mbar") for one in ("mBar", "MBAR", "millibar")),
        *((one, "MPa") for one in ("MPA", "mpa", "Mpa")),
        *((one, "V") for one in ("Volt", "volts", "Volt(s)", "v")),
        *((one, "s") for one in ("sec", "secs", "seconds", "Second(s)", "SEC")),
        *((one, "ms") for one in ("msec", "mSec", "milliseconds", "MS")),
        *((one, "us") for one in ("usec", "microseconds")),
        *((one, "mm") for one in ("MM", "millimeters", "millimetre")),
        *((one, "in") for one in ("inch", "inches", "Inch(es)".replace("(es)", ""))),
        *((one, "deg") for one in ("degree", "degrees", "Deg")),
        *((one, "degC") for one in ("Celsius", "deg C", "° C", "Deg. C", "degrees C")),
        *((one, "N") for one in ("Newton", "Newton(s)", "newtons")),
        *((one, "Nl/min") for one in ("NLPM", "nl/min", "ln/min")),
        *((one, "l/min") for one in ("LPM", "L/min", "L/MIN")),
        *((one, "rpm") for one in ("RPM", "U/min")),
    ],
)
def test_units_are_read_however_they_are_spelled(spelling: str, unit: str) -> None:
    assert parse_unit(spelling) == parse_unit(unit)


@pytest.mark.parametrize(
    ("unit", "pascals"),
    [
        *(("cmH2O", 98.0665), ("mm H2O", 9.80665), ("inH2O", 249.08891), ("inches of water", 249.08891)),
        *(("mWC", 9806.65), ("daPa", 10.0), ("inHg", 3386.38864), ("PSIG", 6894.757293)),
    ],
)
def test_columns_of_water_and_mercury(unit: str, pascals: float) -> None:
    assert parse_unit(unit).factor == pytest.approx(pascals, rel=1e-8)


@pytest.mark.parametrize("text", ["counts", "Count", "ticks", "ADC", "raw", "encoder counts", "LSB"])
def test_counts_are_no_unit(text: str) -> None:
    with pytest.raises(UnitError, match="counts and no unit; state what one count is"):
        parse_unit(text)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("0.1 mm", ("mm", 0.1, True)),
        ("1/10 bar", ("bar", 0.1, True)),
        ("10^-3 V", ("V", 1e-3, True)),
        ("10 kPa", ("kPa", 10.0, True)),
        ("bar x 100", ("bar", 0.01, False)),
        ("bar*10", ("bar", 0.1, False)),
        ("m/s^2", ("m/s^2", 1.0, True)),
        ("m/s2", ("m/s2", 1.0, True)),
    ],
)
def test_factors_beside_units(text: str, found: tuple[str, float, bool]) -> None:
    unit, scale, certain = parse_scaled_unit(text)
    assert (unit, certain) == found[::2]
    assert scale == pytest.approx(found[1])


@pytest.mark.parametrize("text", ["x 100", "10", "foo x 10", "bar x 0"])
def test_a_factor_alone_is_no_unit(text: str) -> None:
    with pytest.raises(UnitError):
        parse_scaled_unit(text)


@pytest.mark.parametrize("text", ["6.283185307179586 rad/s", "360 deg/s", "60 rpm", "60 rev/min", "1 Hz", "1 1/s"])
def test_a_frequency_counts_turns_of_an_angle(text: str) -> None:
    """pint 0.25.3, cf-units 3.3.1 and others say that 60 rpm are 6.28 Hz, and 10 Hz are 10 rad/s."""
    assert parse_quantity(text, "Hz") == pytest.approx(1.0)
    assert parse_quantity("60 rpm", "rad/s") == pytest.approx(2 * math.pi)


def test_a_bandwidth_may_be_stated_as_a_corner() -> None:
    stated = TypeAdapter(Frequency).validate_python("25 rad/s")
    assert stated == pytest.approx(25 / (2 * math.pi))
