"""Figures of a run say what was measured and what each model makes of it, in units that people read."""

from __future__ import annotations

import numpy as np
import pytest

import pneucli


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
    assert len(axis.plot.ladder().axes[0].patches) == 2 * len(axis.ladder)
    image = valve.plot.correlation().axes[0].images[0].get_array()
    np.testing.assert_array_equal(image, valve.correlation)
    (own, u, supply) = valve.plot.residual_correlation("stairs_2", "p1").axes
    assert [a.get_ylabel() for a in (own, u, supply)] == ["with itself", "with u", "with p_supply"]
    assert own.lines[0].get_ydata()[0] == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["driven_9", "x"])
def test_an_unknown_name_is_an_input_error(axis: pneucli.Run, name: str) -> None:
    with pytest.raises(pneucli.InputError, match="was not compared"):
        axis.plot.recording(name)
