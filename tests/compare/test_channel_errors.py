"""Figures of merit by their definitions (interface, section 3), and the regions of errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.compare import Comparison, find_error_regions, overall_error
from pneucli.compare.channel_errors import ChannelResult, compare
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare

TIME = 1e-3 * np.arange(2000)
X = 0.1 + 0.05 * np.sin(2 * np.pi * (TIME + 0.0005))
TURNS = [249, 250, 749, 750, 1249, 1250, 1749, 1750]  # its velocity changes sign between two samples
RIG = Rig(piston_area_1=1e-3, piston_area_2=1e-3, moving_mass=2.0, stroke=0.2)


def comparison(error: np.ndarray, noise: float = 1.0) -> Comparison:
    """A given motion whose measured force is ``error`` beyond what the model needs: no friction, a mass of 2 kg."""
    motion = prepare(recording(np.zeros(TIME.size)), RIG, None)
    model = Model(RIG, (), {"friction.coulomb": 0.0, "friction.viscous": 0.0})
    needed = compare(model, motion, {"force": 1.0}).modelled["force"]
    return compare(model, prepare(recording(needed + error), RIG, None), {"force": noise})


def with_limit(found: Comparison, limit: float) -> Comparison:
    """The same comparison, whose channels would be within a limit for a correct model."""
    return replace(found, results=tuple(replace(r, ratio_limit=limit) for r in found.results))


def recording(force: np.ndarray) -> Recording:
    noise = {"x": NoiseModel(1e-7), "force": NoiseModel(1.0)}
    return Recording("given", "friction", "test", TIME, {"x": X, "force": force}, noise, "open", "motion")


def test_figures_follow_their_definitions() -> None:
    """Over all samples but those beside the four turns of the motion."""
    error = np.random.default_rng(0).standard_normal(TIME.size)
    found = comparison(error, noise=2.0)
    (r,) = found.results
    seen = ~np.isnan(found.measured["force"])
    y, model = found.measured["force"][seen], found.modelled["force"][seen]
    assert np.flatnonzero(~seen).tolist() == TURNS
    assert y - model == pytest.approx(error[seen], abs=1e-9)
    assert r.rmsd == pytest.approx(np.sqrt(np.mean(error[seen] ** 2)))
    assert r.percent == pytest.approx(100 * r.rmsd / np.ptp(y))
    assert r.relative_error_percent == pytest.approx(100 * np.linalg.norm(y - model) / np.linalg.norm(y))
    assert r.fit_percent == pytest.approx(100 * (1 - np.linalg.norm(y - model) / np.linalg.norm(y - y.mean())))
    assert r.ratio_to_noise == pytest.approx(r.rmsd / 2.0)
    assert r.unit == "N"
    of_segments = replace(found, experiment=found.experiment.with_restarts(0.5)).segment_squares["force"]
    assert of_segments.size == 4
    assert np.sum(of_segments) == pytest.approx(r.rmsd**2)
    assert of_segments[2] == pytest.approx(np.sum((y - model)[1000 - 4 : 1500 - 6] ** 2) / seen.sum())


def test_samples_that_were_not_measured_do_not_count() -> None:
    error = np.random.default_rng(1).standard_normal(TIME.size)
    error[500:600] = np.nan
    left = np.delete(error, TURNS)
    assert comparison(error).results[0].rmsd == pytest.approx(np.sqrt(np.nanmean(left**2)))


def test_the_overall_error_is_the_root_mean_square_of_a_use() -> None:
    def result(use: str, ratio: float) -> ChannelResult:
        return ChannelResult("r", use, "x", "m", 1.0, 1.0, 1.0, 1.0, 1.0, ratio, 1.0)

    found = [result("train", 3.0), result("train", 4.0), result("train", float("nan"))]
    assert overall_error(found, "train") == pytest.approx(np.sqrt(12.5))
    assert overall_error(found, "test") is None


def test_the_region_of_an_error_is_found_in_its_own_signal() -> None:
    """Five noises between 0.12 and 0.13 m, in both directions: x names it, though v sees it too."""
    error = np.random.default_rng(2).standard_normal(TIME.size)
    bumpy = (X > 0.12) & (X < 0.13)
    error[bumpy] += 5.0
    regions = find_error_regions([comparison(error)])
    worst = regions[0]
    assert (worst.signal, worst.channel, worst.recording, worst.unit) == ("x", "force", "given", "m")
    assert worst.from_ == pytest.approx(0.12, abs=0.006)
    assert worst.to == pytest.approx(0.13, abs=0.006)
    assert worst.share_of_samples == pytest.approx(bumpy.mean(), abs=0.06)
    share = bumpy.mean()
    assert worst.share_of_error == pytest.approx(26 * share / (25 * share + 1), abs=0.05)  # 1 of noise, 25 on top


def test_regions_come_worst_first() -> None:
    error = np.random.default_rng(3).standard_normal(TIME.size)
    error[(X > 0.12) & (X < 0.13)] += 5.0
    excess = [r.share_of_error - r.share_of_samples for r in find_error_regions([comparison(error)])]
    assert len(excess) > 1
    assert excess == sorted(excess, reverse=True)


def test_noise_has_no_region() -> None:
    error = np.random.default_rng(4).standard_normal(TIME.size)
    assert find_error_regions([comparison(error)]) == []
    assert find_error_regions([comparison(2.0 * error)]) == []  # too much, but nowhere in particular


def test_one_error_over_several_signals_is_one_event() -> None:
    error = np.random.default_rng(3).standard_normal(TIME.size)
    first, second = (TIME > 0.3) & (TIME < 0.4), (TIME > 1.5) & (TIME < 1.52)
    one = find_error_regions([comparison(error + 9.0 * first)])
    assert len(one) > 2
    assert {r.event for r in one} == {0}
    other = comparison(error + 30.0 * second)
    renamed = replace(other.results[0], recording="another")
    both = find_error_regions([comparison(error + 9.0 * first), replace(other, results=(renamed,))])
    assert {r.event for r in both if r.recording == "given"}.isdisjoint(
        r.event for r in both if r.recording == "another"
    )
    assert both[0].event == 0
