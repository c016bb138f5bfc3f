"""The generated kernel: switches, the same text as plain Python, and a cache that notices edits."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli.executors import map_in_threads
from pneucli.physics.effects import catalogue, load_plugin
from pneucli.simulate import build as kernels
from pneucli.simulate import layout as at
from pneucli.simulate.build import ENTRY_POINTS, Kernel, build
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import kernel_arguments, kernel_for, run

from .synthetic_experiments import RIG, held_commands, make_experiment, model, time_grid, typical_values

TIME = time_grid(0.3)
U = held_commands(TIME, (0.0, 2.0, -2.0), 0.1)
RUNS = {
    "valve": lambda: make_experiment("valve", TIME, {"u": U, "p1": 3e5}),
    "friction": lambda: make_experiment("friction", TIME, {"p1": 3e5 + 5e4 * np.sin(40 * TIME), "p2": 3e5}),
    "axis": lambda: make_experiment("axis", TIME, {"u": U, "u2": -U}, "valve", restarts=(0, 150)),
}

DRAG = '''
from pneucli.physics.declaration import Effect, Parameter


def force(x, v, stroke, gain):
    """Drag in N."""
    return -gain * v * abs(v) * {factor}


EFFECT = Effect(
    name="drag", title="Drag", part="cylinder", parameters=(Parameter("gain", "kg/m", 0.0, 0.0, 1e3, (10.0,)),),
    ports={{"force": force}}, equation="", looks_like="", shows_over="v", twins=(), separate="", source="",
)
'''


def bare() -> Model:
    return model((), {"rig.vessel_volume": 1e-3})


def whole() -> Model:
    """Every effect of the catalogue at its first typical value."""
    effects = tuple(catalogue().values())
    return model(list(catalogue()), typical_values(effects) | {"rig.vessel_volume": 1e-3})


def run_in(kernel: Kernel, which: Model, experiment: Experiment, cp: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """As pneucli.simulate.run.run, in a given kernel, ``cp`` being what its ``control`` is told."""
    out = np.zeros((experiment.time.size, at.OUTPUTS))
    arguments = kernel_arguments(kernel, which, experiment, experiment.inputs)
    kernel.run(*arguments, np.zeros(1), np.array(cp), out)
    return out


@pytest.mark.parametrize("kind", RUNS)
@pytest.mark.parametrize("which", [bare, whole])
def test_the_compiled_catalogue_agrees_with_plain_python_of_a_models_own_effects(
    kind: str, which: Callable[[], Model]
) -> None:
    plain = build(which().effects, compiled=False)
    assert run_in(plain, which(), RUNS[kind]()) == pytest.approx(run(which(), RUNS[kind]()), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", RUNS)
def test_with_every_effect_off_the_full_kernel_equals_the_bare_one(kind: str) -> None:
    full, none = (build(of, compiled=False) for of in (tuple(catalogue().values()), ()))
    assert np.array_equal(run_in(none, bare(), RUNS[kind]()), run_in(full, bare(), RUNS[kind]()))


@pytest.mark.parametrize("kind", RUNS)
def test_the_inputs_are_not_changed_and_a_run_repeats_exactly(kind: str) -> None:
    experiment = RUNS[kind]()
    before = experiment.inputs.copy()
    first = run(whole(), experiment)
    assert np.array_equal(run(whole(), experiment), first)
    assert np.array_equal(experiment.inputs, before)


def test_a_kernel_is_compiled_once_for_stamps_of_a_file_and_of_a_calculation() -> None:
    """Those of a file cannot be written."""
    kernel, experiment = kernel_for(()), RUNS["axis"]()
    first = run(bare(), experiment)
    compiled = len(kernel.run.signatures)  # type: ignore[attr-defined]
    locked = experiment.time.copy()
    locked.flags.writeable = False
    recording = replace(experiment.recording, time=locked)
    assert np.array_equal(run(bare(), replace(experiment, recording=recording)), first)
    assert len(kernel.run.signatures) == compiled  # type: ignore[attr-defined]


@pytest.mark.parametrize("kind", ["axis", "friction"])
def test_a_mass_added_in_one_recording_moves_as_the_rigs_own(kind: str) -> None:
    experiment = RUNS[kind]()
    loaded = replace(experiment, recording=replace(experiment.recording, added_mass=1.5))
    heavier = model((), rig=replace(RIG, moving_mass=RIG.moving_mass + 1.5))
    assert np.array_equal(run(model(), loaded), run(heavier, experiment))
    assert not np.array_equal(run(model(), loaded), run(model(), experiment))


def test_parallel_runs_equal_sequential_runs_in_order() -> None:
    jobs = [(model((), {"friction.coulomb": f}), RUNS["axis"]()) for f in np.linspace(5.0, 30.0, 20)]
    for (one, experiment), out in zip(jobs, map_in_threads(lambda job: run(*job), jobs, 3), strict=True):
        assert np.array_equal(run(one, experiment), out)


def test_python_reaches_no_compiled_function_but_the_entry_points() -> None:
    """Another one has no wrapper, and would end the process."""
    assert sorted(vars(kernel_for(()).functions)) == sorted(ENTRY_POINTS)


def test_the_controller_in_the_loop_sees_the_sample_and_its_command_is_held() -> None:
    experiment = make_experiment("axis", TIME, {"u": 0.11})  # the reference stands where the command would
    experiment.flags[at.LOOP] = 1.0
    out = run_in(kernel_for(()), model(), experiment, cp=(60.0, 0.4))
    assert out[:, at.U] == pytest.approx(np.clip(60.0 * (0.11 - out[:, at.X]), -0.4, 0.4))
    held = make_experiment("axis", TIME, {"u": out[:, at.U]})
    assert np.array_equal(run(model(), held)[:, at.X], out[:, at.X])


def test_a_users_effect_works_and_an_edit_of_its_file_is_noticed(tmp_path: Path) -> None:
    file, results = tmp_path / "drag.py", []
    for factor in (1.0, 2.25):  # of different length: Python itself tells edits within a second by it
        file.write_text(DRAG.format(factor=factor))
        effect = load_plugin(file)
        which = Model(model().rig, (effect,), {"friction.coulomb": 0.0, "drag.gain": 10.0})
        experiment = make_experiment("friction", TIME, {"p1": 101_300.0, "p2": 101_300.0, "v": 0.2})
        kernel = build((effect,), compiled=factor == 1.0)  # compiling takes its time
        results.append(run_in(kernel, which, experiment)[:, at.V])
        # m dv/dt = -c v^2 from v0: v = v0 / (1 + c v0 t / m)
        exact = 0.2 / (1 + 10.0 * factor * 0.2 * TIME / 2.2)
        assert np.abs(results[-1] - exact).max() < 1e-5
    assert np.abs(results[0] - results[1]).max() > 0.01


def test_kernels_are_cached_on_disk_one_file_per_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PNEUCLI_CACHE", str(tmp_path))
    monkeypatch.setattr(kernels, "_build", kernels._build.__wrapped__)  # as a new process would find it
    for name in [n for n in sys.modules if n.startswith("pneucli_kernel_")]:
        monkeypatch.delitem(sys.modules, name)
    stribeck, lag = ((catalogue()[name],) for name in ("stribeck", "valve-lag"))
    for effects in (stribeck, lag, stribeck):
        build(effects, compiled=False)
    assert len(list((tmp_path / "kernels").glob("*.py"))) == 2
