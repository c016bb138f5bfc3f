"""``[model.parameters]``: what is known beforehand reaches the fit, and what cannot be meant is told with its key."""

from __future__ import annotations

from pathlib import Path

import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.plausibility.required_inputs import RequiredInput
from pneucli.recording import ParameterPrior, Rig
from pneucli.stages.pipeline_data import require_stated
from pneucli.stages.pipeline_file import parameter_priors, with_started_supply
from tests.config.test_config import BASE, write


def known(tmp_path: Path, entries: str) -> dict[str, ParameterPrior]:
    (tmp_path / "raw").mkdir(exist_ok=True)
    path = tmp_path / "pipeline.toml"
    path.write_text(BASE.replace("[checks]", f"[model.parameters]\n{entries}\n[checks]"))
    return parameter_priors(load(path), catalogue())


def test_quantities_are_read_in_the_parameters_own_unit(tmp_path: Path) -> None:
    found = known(
        tmp_path,
        """
        "friction.viscous" = { fixed = "45 N s/m" }
        "rig.moving_mass" = { start = "2.2 kg", min = "2000 g", max = 3, sigma = "0.1 kg" }
        "rig.piston_area_1" = { sigma = "0.1 cm^2" }
        "pressure-friction.gain" = { max = "2 1/MPa" }
        "valve.effective_area(+1 V)" = { max = "1 mm^2" }
        """,
    )
    assert found["friction.viscous"] == ParameterPrior("N s/m", fixed=45.0)
    assert found["rig.moving_mass"] == ParameterPrior("kg", None, 2.2, 2.0, 3.0, 0.1)
    assert (found["rig.piston_area_1"].start, found["rig.piston_area_1"].sigma) == pytest.approx((9.5e-4, 1e-5))
    assert found["valve.effective_area(+1 V)"].upper == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ('"friction.viscos" = { fixed = 1 }', 'did you mean "friction.viscous"?'),
        ('"friction.viscous" = { fixed = "45 N" }', '"friction.viscous".fixed: "45 N" has not the dimension'),
        ('"friction.viscous" = {}', "nothing is said of it"),
        ('"friction.viscous" = { fixed = 1, max = 2 }', "what is fixed has no max"),
        ('"friction.viscous" = { min = 2, max = 1 }', "is not below max"),
        ('"friction.viscous" = { start = 3, max = 1 }', "lies outside"),
        ('"friction.viscous" = { sigma = 1 }', "sigma without start"),
        ('"rig.piston_area_1" = { sigma = 0 }', "above 0"),
    ],
)
def test_what_cannot_be_meant_is_told_with_its_key(tmp_path: Path, entry: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        known(tmp_path, entry)
    assert says in str(error.value)
    assert "model.parameters" in str(error.value)


def test_the_file_without_entries_knows_nothing(tmp_path: Path) -> None:
    assert parameter_priors(load(write(tmp_path)), catalogue()) == {}


def test_every_key_that_is_missing_is_told_with_an_example(tmp_path: Path) -> None:
    area = RequiredInput("rig.cylinder", "piston_area_1", "the area on which p1 acts (axis_1)", '"8.04 cm^2"')
    pressure = RequiredInput("[recordings]", "p2", "the pressure of chamber 2 (axis_1)", '"1.013 bar"')
    with pytest.raises(InputError) as error:
        require_stated([area, pressure], tmp_path / "p.toml")
    assert "key rig.cylinder.piston_area_1: missing" in str(error.value)
    assert 'add piston_area_1 = "8.04 cm^2" below [rig.cylinder]' in str(error.value)
    assert "key recordings.p2: missing" in str(error.value)
    require_stated([], tmp_path / "p.toml")


@pytest.mark.parametrize(
    ("entry", "supply"), [('start = "8 bar"', 8e5), ('fixed = "7 bar"', 7e5), ('min = "1 bar"', None)]
)
def test_a_pump_states_its_stall_pressure_as_a_start_in_place_of_a_regulated_supply(
    tmp_path: Path, entry: str, supply: float | None
) -> None:
    (tmp_path / "raw").mkdir()
    path = tmp_path / "pipeline.toml"
    path.write_text(BASE.replace("[checks]", f'[model.parameters]\n"rig.supply_pressure" = {{ {entry} }}\n[checks]'))
    assert with_started_supply(Rig(), load(path)).supply_pressure == (supply and pytest.approx(supply))
    assert with_started_supply(Rig(supply_pressure=6e5), load(path)).supply_pressure == 6e5
