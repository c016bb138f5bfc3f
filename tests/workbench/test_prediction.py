"""What is shown while the hand moves over a long recording: a line between two simulations, until a third is there."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.compare import Comparison
from pneucli.compare.channel_errors import channel_result
from pneucli.workbench import live_model
from pneucli.workbench.prediction import MAX_REACH, MAX_SIMULATED, Prediction, Simulated
from tests.workbench.conftest import Asked, Session
from tests.workbench.test_server import unpack

Start = Callable[[Session], None]
NAME = "friction.coulomb"


def simulated(**values: float) -> Simulated:
    return Simulated("model", values, {"run": None}, 1.0)  # type: ignore[dict-item]


def line(prediction: Prediction, asked: float, moving: str = "a", **others: float) -> tuple[float, float, float] | None:
    found = prediction.line("model", {moving: asked, **others}, moving, 0.0, ["run"])
    ends = [] if found is None else [one.values.get(moving, 0.0) for one in (found.first, found.second)]
    return None if found is None else (ends[0], ends[1], found.share)


def test_the_line_leads_through_the_two_nearest_simulations_that_are_equal_in_all_else() -> None:
    prediction = Prediction()
    prediction.keep(simulated())
    assert line(prediction, 2.0) is None
    prediction.keep(simulated(a=4.0))
    assert line(prediction, 1.0) == (0.0, 4.0, 0.25)
    prediction.keep(simulated(a=2.0))
    assert line(prediction, 3.5) == (4.0, 2.0, 0.25)
    assert line(prediction, 1.0, b=1.0) is None
    assert line(prediction, 1.0, moving="b") is None
    assert prediction.line("another model", {"a": 1.0}, "a", 0.0, ["run"]) is None
    assert prediction.line("model", {"a": 1.0}, "a", 0.0, ["another run"]) is None


def test_a_line_is_not_carried_on_beyond_its_reach() -> None:
    prediction = Prediction()
    prediction.keep(simulated())
    prediction.keep(simulated(a=1.0))
    assert line(prediction, MAX_REACH) is not None
    assert line(prediction, MAX_REACH + 2.0) is None


def test_only_the_last_simulations_are_kept() -> None:
    prediction = Prediction()
    for value in range(MAX_SIMULATED + 1):
        prediction.keep(simulated(a=float(value)))
    assert prediction.same("model", {"a": 0.0}, ["run"]) is None
    assert prediction.same("model", {"a": 1.0}, ["run"]) is not None
    assert prediction.same("model", {"a": 1.0}, ["another run"]) is None


def test_the_errors_are_those_of_the_predicted_curves_also_with_gaps(session: Start) -> None:
    async def work(asked: Asked) -> None:
        live = asked.workbench.bench.require_live()
        found = [live.comparison(live.variant(live_model.Variant({NAME: v}), ""), "driven_1") for v in (9.0, 12.0)]
        measured = {c: np.where(np.arange(y.size) % 50 == 3, np.nan, y) for c, y in found[0].measured.items()}
        first, second = (_with(each, measured) for each in found)
        prediction = Prediction()
        for value, each in ((9.0, first), (12.0, second)):
            prediction.keep(Simulated("", {NAME: value}, {"driven_1": each}, 1.0))
        through = prediction.line("", {NAME: 10.0}, NAME, 0.0, ["driven_1"])
        assert through is not None
        tables, results, rows = prediction.tables(through, "driven_1", (-math.inf, math.inf), 40_000)
        assert results
        for one in results:
            curve = first.modelled[one.channel] + (second.modelled[one.channel] - first.modelled[one.channel]) / 3.0
            recording = first.experiment.recording
            wanted = channel_result(recording, one.channel, measured[one.channel], curve, one.noise)
            assert one.ratio_to_noise == pytest.approx(wanted.ratio_to_noise)
            assert one.fit_percent == pytest.approx(wanted.fit_percent)
            assert tables[one.channel]["model"] == pytest.approx(curve[rows])

    session(work)


def _with(found: Comparison, measured: dict[str, Any]) -> Comparison:
    """Return a comparison with other measurements, its errors anew."""
    results = tuple(
        channel_result(found.experiment.recording, r.channel, measured[r.channel], found.modelled[r.channel], r.noise)
        for r in found.results
    )
    return replace(found, measured=measured, results=results)


def test_a_hand_is_followed_by_a_line_and_simulations_come_after_it(
    session: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_model, "MAX_SIMULATION", 0.0)

    async def curves(asked: Asked, values: dict[str, float], moving: str | None = NAME) -> tuple[bool, Any, Any]:
        interval = await asked.interval("driven_1")
        content = {"focus": "driven_1", "values": values, "moving": moving, "samples": 40_000, "interval": interval}
        head, arrays = unpack((await asked.post("/curves", content))[1])
        return head["predicted"], arrays, {one["channel"]: one["ratio"] for one in head["errors"]}

    async def work(asked: Asked) -> None:
        assert not (await curves(asked, {}))[0]
        assert not (await curves(asked, {NAME: 10.0}))[0]
        is_predicted, arrays, errors = await curves(asked, {NAME: 10.2})
        assert is_predicted
        deadline = asyncio.get_running_loop().time() + 20.0
        while (await curves(asked, {NAME: 10.2}))[0] and asyncio.get_running_loop().time() < deadline:
            await asyncio.sleep(0.02)
        is_predicted, exact, right = await curves(asked, {NAME: 10.2})
        assert not is_predicted
        assert errors == pytest.approx(right, rel=0.02)
        assert [one.shape for one in arrays] == [one.shape for one in exact]
        assert not (await curves(asked, {NAME: 11.0}, None))[0]

    session(work)


def test_a_short_simulation_is_never_predicted(session: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_model, "MAX_SIMULATION", 10.0)

    async def work(asked: Asked) -> None:
        for value in (10.0, 10.1, 10.2):
            content = {"focus": "driven_1", "values": {NAME: value}, "moving": NAME}
            head, _ = unpack((await asked.post("/curves", content))[1])
            assert not head["predicted"]

    session(work)
