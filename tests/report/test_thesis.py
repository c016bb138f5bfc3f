"""Figures of the thesis on friction laws, the sliding sector, and pressure control."""

from __future__ import annotations

import re

import numpy as np

from pneucli.report.report_data import ReportData, Table
from pneucli.report.thesis.friction import friction_laws, sliding_sectors
from pneucli.report.thesis.valve import section as thesis

STRIBECK = (("coulomb", 14.0), ("viscous", 45.0), ("static", 22.0), ("velocity", 0.015))
ROWS = [
    *(("A", "both", n, v) for n, v in STRIBECK),
    *(
        ("D", "accelerating", n, v)
        for n, v in (("coulomb", 14.0), ("viscous", 45.0), ("static", 22.0), ("velocity", 0.015))
    ),
    *(("D", "slowing", n, v) for n, v in (("coulomb", 12.0), ("viscous", 40.0))),
]
PARAMETERS = Table(dict(zip(("model", "branch", "name", "value"), map(list, zip(*ROWS, strict=True)), strict=True)))
SECTOR = {"lambda_1": 14.0, "lambda_2": 28.0, "eta": 2.8}
TIME = 1e-3 * np.arange(500)


def trajectory() -> Table:
    reference = np.full(TIME.size, 0.1)
    x = 0.1 + 1e-3 * np.exp(-20.0 * TIME)
    return Table(
        {
            "controller": ["sector"] * TIME.size,
            "scenario": ["steps"] * TIME.size,
            "time": TIME,
            "x": x,
            "v": -20.0 * (x - 0.1),
            "x_shaped": reference,
        }
    )


def test_the_friction_laws_are_those_of_the_identified_parameters() -> None:
    captions = [
        one.caption for one in friction_laws(ReportData("demo", {}, {"identify/friction_parameters": PARAMETERS}))
    ]
    assert [re.findall(r"Figures? ([\d.]+)", caption)[0] for caption in captions] == ["3.1", "3.6"]


def test_the_sector_is_drawn_with_its_lines_and_the_trajectory() -> None:
    material = ReportData(
        "demo", {"design": {"sector": {"design": SECTOR}}}, {"design/comparison_signals": trajectory()}
    )
    (one,) = sliding_sectors(material)
    assert "5.1, 6.20 and 8.6" in one.caption
    assert "14 and 28 1/s (eta 2.8 s/m)" in one.caption
    assert "trajectory" in one.svg


def test_without_a_sector_or_its_run_nothing_is_drawn() -> None:
    assert not list(sliding_sectors(ReportData("demo", {"design": {"sector": {}}}, {})))
    assert not list(friction_laws(ReportData("demo")))


def inflation(**more: object) -> str:
    p = np.linspace(1e5, 6e5, 60)
    curve = {"recording": ["step"] * 60, "u": np.full(60, 5.0), "time": TIME[:60], "measured": p, "fitted": p}
    curves = Table(curve | {"gradient": np.linspace(2e6, 1e5, 60), "mass_flow": np.linspace(1e-3, 1e-4, 60)} | more)
    signals = Table({"recording": ["step"] * 60, "p_supply": np.full(60, 7e5)})
    tables = {"identify/valve_curves": curves, "ingest/signals": signals}
    section = thesis(ReportData("demo", {}, tables))
    assert section is not None
    return " ".join(f"{part.caption} {part.svg}" for part in section.parts)


def test_the_flow_coefficient_is_over_the_recorded_supply_and_the_mass_flow_in_grams() -> None:
    assert "recorded supply pressure" in inflation()
    assert "mass flow in g/s" in inflation()
    assert "volume of the vessel is not stated" in inflation(mass_flow=np.full(60, np.nan))
