"""Figures of a run say what was measured and what each model makes of it, in units that people read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import pneucli
from pneucli.messages.history import Model
from pneucli.notebook import plots
from pneucli.notebook.plots import GAP_NOTE


def test_a_recording_is_drawn_by_channel_with_its_fit(axis: pneucli.Run) -> None:
    figure = axis.plot.recording("driven_2", ["x", "v"])
    x, _ = figure.axes
    rows = axis.residuals.query("recording == 'driven_2' and channel == 'x'")
    np.testing.assert_allclose(x.lines[0].get_ydata(), 1e3 * rows["measured"])
    assert x.get_ylabel() == "x in mm"
    answer = next(c for c in axis.answer("compare")["channels"] if (c["recording"], c["channel"]) == ("driven_2", "x"))
    assert f"fit {answer['fit_percent']:.1f} %" in x.lines[1].get_label()
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_models_of_other_runs_are_in_the_same_panel(axis: pneucli.Run) -> None:
    (panel,) = axis.plot.recording("driven_2", ["x"], compare_with=[axis]).axes
    assert len(panel.lines) == 3


def test_every_model_that_was_compared_is_drawn(axis: pneucli.Run) -> None:
    (panel,) = axis.plot.models("driven_2", ["x"]).axes
    labels = [line.get_label() for line in panel.lines]
    assert labels[0] == "measured"
    assert labels[1].startswith("base (present): fit ")


def test_the_other_figures_come_out(valve: pneucli.Run, axis: pneucli.Run) -> None:
    assert valve.plot.valve_map().axes[0].get_ylabel() == "pressure of chamber 1 in bar"
    image = valve.plot.correlation().axes[0].images[0].get_array()
    np.testing.assert_array_equal(image, valve.correlation)
    (own, u, supply) = valve.plot.residual_correlation("stairs_2", "p1").axes
    assert [a.get_ylabel() for a in (own, u, supply)] == ["with itself", "with u", "with p_supply"]
    assert own.lines[0].get_ydata()[0] == pytest.approx(1.0)


def labels(figure: Any) -> list[str]:
    return [tick.get_text() for tick in figure.axes[0].get_yticklabels()]


def test_the_ladder_shows_the_models_before_the_present_one_and_what_is_suggested(
    axis: pneucli.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after ``add``: the diagnosis knows only the present model, the history also the one before."""
    compared = [
        Model(effects, {"test": error, "train": None}, data, "", i == 2, {})
        for i, (effects, error, data) in enumerate([([], 9.0, "old"), ([], 8.0, "d"), (["stribeck"], 2.0, "d")])
    ]
    monkeypatch.setattr(plots, "compared_models", lambda folder: compared)
    steps = pd.DataFrame({"add": [None, "piston-leak"], "error_train": [1.0, 1.0], "error_test": [2.0, 1.1]})
    monkeypatch.setattr(type(axis), "ladder", steps)
    figure = axis.plot.ladder()
    assert labels(figure) == ["base model", "+ stribeck (present)", "+ piston-leak"]
    test_bars = [bar.get_width() for bar in figure.axes[0].patches[:3]]
    assert test_bars == [8.0, 2.0, 1.1]


def test_a_gap_in_the_model_is_explained(axis: pneucli.Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert GAP_NOTE not in [axis.plot.recording("driven_2", ["x"]).axes[0].get_title(loc="right")]
    rows = axis.residuals.copy()
    at_end = rows.index[(rows["recording"] == "driven_2") & (rows["channel"] == "x")][100:200]
    rows.loc[at_end, ["measured", "residual"]] = np.nan
    monkeypatch.setattr(type(axis), "residuals", rows)
    (panel,) = axis.plot.recording("driven_2", ["x"]).axes
    assert panel.get_title(loc="right") == GAP_NOTE
    assert np.isnan(panel.lines[1].get_ydata()[100:200]).all()


def test_the_ladder_of_a_run_that_was_compared_once(axis: pneucli.Run) -> None:
    assert labels(axis.plot.ladder())[0] == "base model (present)"


@pytest.mark.parametrize("name", ["driven_9", "x"])
def test_an_unknown_name_is_an_input_error(axis: pneucli.Run, name: str) -> None:
    with pytest.raises(pneucli.InputError, match="was not compared"):
        axis.plot.recording(name)
