"""One declaration for both chambers: where its variants enter, and what they say."""

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.physics.effects import all_effects, catalogue, catalogue_with_sides, load_plugin
from pneucli.physics.ports import PORTS
from pneucli.physics.sides import declared_name, variants
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import FRICTION, VALVE, make_experiment, model, time_grid
from tests.simulate.test_build import run_in


@pytest.mark.parametrize(
    ("name", "ports"),
    [
        ("chamber-leak:2", {"leak_2_ambient"}),
        ("laminar-leak:2", {"leak_2_ambient"}),
        ("dead-volume:2", {"volume_2"}),
        ("pressure-offset:2", {"read_p2", "unread_p2"}),
        ("line-delay:1", {"flow_delay_1", "hose_bore_1"}),
        ("line-delay:2", {"flow_delay_2", "hose_bore_2"}),
        ("pressure-scale:1", {"read_p1", "unread_p1"}),
        ("pressure-scale:2", {"read_p2", "unread_p2"}),
    ],
)
def test_a_variant_enters_at_the_ports_of_its_side(name: str, ports: set[str]) -> None:
    variant, declared = catalogue_with_sides()[name], catalogue()[declared_name(name)]
    assert set(variant.ports) == ports
    assert set(variant.ports.values()) <= set(declared.ports.values())
    assert variant.parameters == declared.parameters
    assert variant.side == int(name[-1])


def test_what_stands_at_no_chamber_has_no_variant() -> None:
    sided = {declared_name(name) for name in catalogue_with_sides().keys() - catalogue().keys()}
    for effect in catalogue().values():
        assert (effect.name in sided) == bool(variants(effect))
    assert not sided & {"stribeck", "heat-transfer", "valve-leak", "piston-leak", "acceleration-bias", "extra-mass"}
    assert all(port in PORTS for effect in catalogue_with_sides().values() for port in effect.ports)


def test_a_variant_speaks_of_its_chamber() -> None:
    known = catalogue_with_sides()
    assert known["chamber-leak:2"].title == "Leak of chamber 2 to ambient"
    assert "p_2" in known["chamber-leak:2"].equation
    assert "p_1" not in known["chamber-leak:2"].equation
    assert known["dead-volume:2"].equation == "$V_2 = V_{02} + V_{add} + A_2 (L - x)$"
    assert "leaving chamber 2" in known["laminar-leak:2"].equation
    assert known["pressure-offset:2"].shows_over == "p2"
    assert known["pressure-scale:2"].title.endswith("p2 alone")


def test_the_declared_effects_are_as_they_were() -> None:
    assert all(all_effects()[name] is effect for name, effect in catalogue().items())
    assert all(effect.side is None for effect in catalogue().values())


@pytest.mark.parametrize(
    ("signals", "chamber_2", "shown"),
    [
        ({"u", "p1", "x"}, "open", {"chamber-leak", "line-delay", "pressure-scale", "pressure-offset"}),
        (
            {"u", "p1", "x"},
            "closed",
            {"chamber-leak", "chamber-leak:2", "line-delay", "pressure-scale", "pressure-offset"},
        ),
        (
            {"u", "p1", "p2", "x"},
            "valve",
            {"chamber-leak", "chamber-leak:2", "pressure-scale", "pressure-scale:1", "pressure-scale:2"}
            | {"pressure-offset", "pressure-offset:2", "line-delay", "line-delay:1", "line-delay:2"},
        ),
        (
            {"u", "p1", "p2", "x", "a"},
            "open",
            {"chamber-leak", "pressure-scale", "pressure-scale:1", "pressure-scale:2", "acceleration-bias"}
            | {"pressure-offset", "pressure-offset:2", "line-delay"},
        ),
    ],
)
def test_an_effect_can_show_where_its_chamber_is_shut_and_its_sensor_recorded(
    signals: set[str], chamber_2: str, shown: set[str]
) -> None:
    e = make_experiment("axis", time_grid(0.1), dict.fromkeys(signals, 0.0), chamber_2=chamber_2)
    raw = {name: values for name, values in e.raw.items() if name in signals}
    e = replace(e, raw=raw)
    asked = {"chamber-leak", "line-delay", "pressure-scale", "pressure-offset", "acceleration-bias"}
    found = {n for n, effect in catalogue_with_sides().items() if declared_name(n) in asked and e.can_show(effect)}
    assert found == shown


@pytest.mark.parametrize("chamber", [1, 2])
def test_a_hose_delays_the_flow_of_its_own_chamber(chamber: int) -> None:
    """Both chambers are filled from 10 ms on; through a hose of 20 ms one begins that much later."""
    time = time_grid(0.08)
    signals = {"u": np.where(time < 0.01, 0.0, 5.0), "u2": np.where(time < 0.01, 0.0, 5.0), "x": 0.1, "v": 0.0}
    e = make_experiment("axis", time, signals, chamber_2="valve").without_mechanics()
    name = f"line-delay:{chamber}"
    delayed = replace(
        Model(e.rig, (catalogue_with_sides()[name],), {**FRICTION, f"{name}.delay": 0.02}, VALVE), valve_2=VALVE
    )
    plain = Model(e.rig, (), FRICTION, VALVE, VALVE)
    for side in (1, 2):
        late, soon = simulate(delayed, e)[f"p{side}"], simulate(plain, e)[f"p{side}"]
        shift = 20 if side == chamber else 0
        assert late[shift:] == pytest.approx(soon[: soon.size - shift], rel=1e-3)


# --- plugins: helpers and constants of the file work, and each error names the file


ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "rod_wiper.py"
TIME = time_grid(0.3)
HEAD = "import math\nfrom pneucli.physics.declaration import Effect, Parameter\n"
TAIL = """
EFFECT = Effect("own", "Own", "{part}", (Parameter("gain", "1", 0.0, 0.0, 1.0, (0.1,)),), {{"{port}": {function}}},
                "", "", "x", (), "", "")
"""


def written(folder: Path, functions: str, port: str = "force", part: str = "cylinder", function: str = "f") -> Path:
    file = folder / "own.py"
    file.write_text(HEAD + functions + TAIL.format(port=port, part=part, function=function))
    return file


def test_the_worked_example_slows_the_way_back_by_its_parameter() -> None:
    """Wiper full: friction is (1 + gain) times as much, and the piston stops in that much less time."""
    effect = load_plugin(EXAMPLE)
    runs = []
    for gain in (0.0, 1.0):
        which = Model(model().rig, (effect,), {"friction.coulomb": 20.0, "rod-wiper.gain": gain})
        experiment = make_experiment("friction", TIME, {"p1": 101_300.0, "p2": 101_300.0, "v": -0.2, "x": 0.15})
        runs.append(run_in(build((effect,), compiled=False), which, experiment)[:, at.V])
    start = [float(np.polyfit(TIME[:5], v[:5], 1)[0]) for v in runs]
    assert start[0] == pytest.approx(20.0 / 2.2, rel=1e-3)
    assert start[1] == pytest.approx(2 * start[0], rel=1e-3)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("v", [0.01, 0.03, -0.02])
def test_stribeck_friction_with_an_exponent_is_a_choice_of_the_simulation(exponent: float, v: float) -> None:
    """A piston that slides freely decelerates by the friction of (3.5) at its speed."""
    effect = load_plugin(ROOT / "docs" / "examples" / "stribeck_exponent.py")
    own = {"static": 30.0, "velocity": 0.02, "exponent": exponent}
    values = {"friction.coulomb": 20.0} | {f"stribeck-exponent.{name}": value for name, value in own.items()}
    which = Model(model().rig, (effect,), values)
    time = 1e-5 * np.arange(3)
    experiment = make_experiment("friction", time, {"p1": 101_300.0, "p2": 101_300.0, "v": v})
    moved = run_in(build((effect,), compiled=False), which, experiment)[:, at.V]
    friction = 20.0 + 10.0 * np.exp(-(abs(v / 0.02) ** exponent))
    assert moved[0] == pytest.approx(v)
    assert (moved[1] - moved[0]) / (time[1] - time[0]) == pytest.approx(-np.sign(v) * friction / 2.2, rel=0.01)


def test_the_tests_on_the_page_pass() -> None:
    page = (ROOT / "docs" / "own-effect.md").read_text(encoding="utf-8")
    (tests,) = [block for block in page.split("```python\n")[1:] if block.startswith("import rod_wiper")]
    module = SimpleNamespace(**runpy.run_path(str(EXAMPLE)))
    names: dict[str, object] = {"rod_wiper": module}
    exec(tests.partition("```")[0].replace("import rod_wiper", ""), names)
    found = [f for name, f in names.items() if name.startswith("test_")]
    assert len(found) == 3
    for one in found:
        one()  # type: ignore[operator]


def test_helpers_and_constants_of_the_file_are_compiled_with_it(tmp_path: Path) -> None:
    text = "HALF = 0.5\ndef inner(x):\n    return HALF * x\n" + RIGHT.replace(
        "gain * v", "-gain * inner(v) * math.exp(0.0)"
    )
    effect = load_plugin(written(tmp_path, text))
    kernel = build((effect,))
    base, force = np.zeros(len(at.BASE_NAMES)), np.zeros(1)
    on = kernel.effect_switches([effect.name])
    kernel.functions.run_forces(np.array([0.1]), np.array([3.0]), base, np.array([2.0, 0.0]), on, force)
    assert force == -3.0


def test_two_files_may_have_helpers_of_the_same_name(tmp_path: Path) -> None:
    effects = []
    for name, factor in (("one", 1.0), ("two", 2.0)):
        text = f"def inner(v):\n    return {factor} * v\ndef f(x, v, stroke, gain):\n    return gain * inner(v)\n"
        (tmp_path / name).mkdir()
        file = written(tmp_path / name, text)
        file.write_text(file.read_text().replace('"own"', f'"{name}"'))
        effects.append(load_plugin(file))
    force = build(tuple(effects), compiled=False).functions.force
    assert force(0.0, 1.0, 0.2, [1.0, 1.0, 0.0], [1, 1, 0]) == 3.0


RIGHT = "def f(x, v, stroke, gain):\n    return gain * v\n"
FAULTS = {
    "too few arguments": (RIGHT.replace("stroke, ", ""), {}, r"takes 3 arguments, not 4"),
    "arguments with a star": ("def f(*x):\n    return 0.0\n", {}, r"takes 1 arguments, not 4"),
    "a name that is nowhere": (RIGHT.replace("* v", "* vv"), {}, '"vv", which the simulator does not know'),
    "a helper that is not there": (RIGHT.replace("gain * v", "helper(v)"), {}, '"helper"'),
    "a fault in a helper": ("def h(v):\n    return w\n" + RIGHT.replace("gain * v", "h(v)"), {}, 'h uses "w"'),
    "a helper that calls itself": (
        "def h(v):\n    return h(v)\n" + RIGHT.replace("gain * v", "h(v)"),
        {},
        "calls itself",
    ),
    "numpy": ("import numpy as np\n" + RIGHT.replace("gain * v", "np.sin(gain)"), {}, '"np"'),
    "an attribute that math has not": (RIGHT.replace("gain * v", "math.sinus(gain)"), {}, "math.sinus"),
    "a list": (RIGHT.replace("gain * v", "[gain][0]"), {}, "has a"),
    "a text": (RIGHT.replace("gain * v", "float('1')"), {}, "has a constant"),
    "a lambda": ("f = lambda x, v, stroke, gain: gain * v\n", {}, "no plain function"),
    "an answer that is none": (RIGHT.replace("return gain * v", "gain = v"), {}, "gives None"),
    "a state without a state": (
        "def f(u, s, h, gain):\n    return u\n",
        {"port": "command", "part": "valve"},
        "two numbers",
    ),
    "an unknown part": (RIGHT, {"part": "cilinder"}, 'did you mean "cylinder"'),
    "it does not run": ("import nowhere\n" + RIGHT, {}, "line 3: it does not run"),
}


@pytest.mark.parametrize(("functions", "more", "said"), FAULTS.values(), ids=FAULTS)
def test_an_error_names_the_file(tmp_path: Path, functions: str, more: dict[str, str], said: str) -> None:
    file = written(tmp_path, functions, **more)
    with pytest.raises(InputError, match=said) as error:
        load_plugin(file)
    assert str(file) in str(error.value)
    assert error.value.exit_code == 2


def test_a_plugin_cannot_take_a_name_of_the_catalogue(tmp_path: Path) -> None:
    file = written(tmp_path, RIGHT)
    file.write_text(file.read_text().replace('"own"', '"stribeck"'))
    with pytest.raises(InputError, match="is an effect of the catalogue"):
        load_plugin(file)


def test_a_division_by_zero_at_the_probe_is_accepted(tmp_path: Path) -> None:
    assert load_plugin(written(tmp_path, RIGHT.replace("* v", "/ (1.0 - v)"))).name == "own"
