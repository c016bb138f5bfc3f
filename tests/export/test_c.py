"""The exported C is the simulated controller, and behaves as C should."""

import math
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from benchmarks.robust import FAULTS, commissioned_with, designed_rig
from pneucli.closed_loop.commissioning import (
    SHUT,
    STATES,
    added_times,
    commissioned,
    run_commissioning,
    with_commissioning,
    with_time,
)
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.operation import active_reference, finish_commands
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.errors import InputError
from pneucli.exam.rig.parameters import Parameters
from pneucli.export import export_files
from pneucli.export.c_source import c_function
from pneucli.export.controller_program import checked_prefix
from pneucli.export.export_files import write_c_source
from pneucli.messages.compare import Commissioned
from pneucli.messages.export import PrecisionCost
from tests.design import axis

CONTROLLER, MODEL = axis.controller(), axis.model()
STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export")
    export_files.write_c(path, CONTROLLER, MODEL, axis.BENCH, "demo */ evil")
    return path


def build(folder: Path, *options: str) -> Path:
    program = folder / f"replay{'_'.join(options)}".replace("/", "")
    sources = [folder / "pneucli_replay.c", folder / "pneucli_controller.c"]
    subprocess.run(["gcc", "-std=c11", *STRICT, *options, *sources, "-lm", "-o", program], check=True)
    return program


def replay(program: Path, folder: Path) -> tuple[int, float, float, float]:
    done = subprocess.run([program, folder / export_files.REPLAY_FILE], check=True, capture_output=True, text=True)
    samples, worst, longest, mean = done.stdout.split()
    return int(samples), float(worst), float(longest), float(mean)


def test_the_controller_is_clean_c99(folder: Path) -> None:
    source, result = folder / "pneucli_controller.c", folder / "c99.o"
    subprocess.run(["gcc", "-std=c99", "-O2", *STRICT, "-c", source, "-o", result], check=True)
    needed = subprocess.run(["nm", "-u", result], check=True, capture_output=True, text=True).stdout
    # gcc makes a loop that copies into memcpy, which it asks of a target without a library too
    assert {word for word in needed.split() if word != "U" and not word.startswith("_")} <= {"sqrt", "fabs", "memcpy"}


def test_over_a_minute_it_gives_the_simulated_commands_to_1e_9_volt(folder: Path) -> None:
    samples, worst, _, mean = replay(build(folder, "-O2"), folder)
    assert samples == 68_000
    assert worst <= 1e-9
    assert mean < 1e-5  # a hundredth of its period, on any machine that runs this


@pytest.mark.parametrize(
    ("law", "arrangement"),
    [*((name, "one-chamber") for name in LAWS), ("pid", "5/3"), ("compensated", "two"), ("pdc", "two")],
)
def test_the_c_of_every_law_gives_its_simulated_commands(law: str, arrangement: str, tmp_path: Path) -> None:
    """The readings are those of the simulated loop, so that no bit can part the ways of the two pistons."""
    model, made = axis.bench_of_laws(arrangement)
    export_files.write_c(tmp_path, made[law], model, axis.BENCH, law)
    samples, worst, _, mean = replay(build(tmp_path, "-O2"), tmp_path)
    assert samples == 68_000
    assert worst <= 1e-9
    assert mean < 2e-5


TWO = """
#include "axis1_controller.h"
#include "axis2_controller.h"
#include <stdio.h>

int main(void)
{
    static axis1_controller one;
    static axis2_controller two;
    double u[2], w[2], sums[2] = {0.0, 0.0};
    int i;
    axis1_controller_init(&one);
    axis2_controller_init(&two);
    for (i = 0; i < 200; ++i) {
        axis1_controller_step(&one, 0.1005, 0.1, 3e5, 3e5, u);
        axis2_controller_step(&two, 0.1005, 0.1, 3e5, 3e5, w);
        sums[0] += u[0];
        sums[1] += w[0];
    }
    printf("%.17g %.17g %s %s\\n", sums[0], sums[1], AXIS1_CONTROLLER_HASH, AXIS2_CONTROLLER_HASH);
    return 0;
}
"""


def test_two_controllers_with_prefixes_run_in_one_program_as_each_runs_alone(tmp_path: Path) -> None:
    made = axis.bench_of_laws()[1]
    wanted = []
    for prefix, law in (("axis1", "pid"), ("axis2", "best")):
        export_files.write_c_source(tmp_path, made[law], "demo", prefix=prefix)
        s, c = np.zeros(layout.L_STATES), made[law].vector()
        total = 0.0
        for _ in range(200):
            LAWS[law].step(active_reference(0.1005, 0.1, 3e5, 3e5, s, c), 0.1, 3e5, 3e5, s, c)
            finish_commands(s, c)
            total += s[layout.S_U1]
        wanted.append(total)
    (tmp_path / "two.c").write_text(TWO)
    sources = [tmp_path / name for name in ("two.c", "axis1_controller.c", "axis2_controller.c")]
    subprocess.run(["gcc", "-std=c99", *STRICT, *sources, "-lm", "-o", tmp_path / "two"], check=True)
    found = subprocess.run([tmp_path / "two"], check=True, capture_output=True, text=True).stdout.split()
    assert [float(u) for u in found[:2]] == pytest.approx(wanted, rel=1e-12)
    assert wanted[0] != pytest.approx(wanted[1], rel=0.01)
    assert found[2] != found[3]


def test_a_replay_with_a_prefix_is_that_of_its_own_names(tmp_path: Path) -> None:
    export_files.write_c(tmp_path, CONTROLLER, MODEL, axis.BENCH, "demo", prefix="axis1")
    sources = [tmp_path / "axis1_replay.c", tmp_path / "axis1_controller.c"]
    subprocess.run(["gcc", "-std=c11", *STRICT, *sources, "-lm", "-o", tmp_path / "replay"], check=True)
    subprocess.run([tmp_path / "replay", tmp_path / "axis1_replay.csv"], check=True, capture_output=True)


@pytest.mark.parametrize("prefix", ["", "a", "1axis", "Axis", "axis-1", "axis__1", "axis_", "a" * 25, "int main"])
def test_a_prefix_that_a_language_refuses_is_refused(prefix: str) -> None:
    with pytest.raises(InputError, match="--prefix"):
        checked_prefix(prefix, "--prefix")


def test_the_sanitizers_find_nothing(folder: Path) -> None:
    program = build(folder, "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    assert replay(program, folder)[1] <= 1e-9


def test_the_minute_passes_through_saturation_rest_motion_and_missing_readings(folder: Path) -> None:
    table = np.genfromtxt(folder / export_files.REPLAY_FILE, delimiter=",", names=True)
    assert np.abs(table["u1"]).max() == CONTROLLER.values["C_U_MAX"]
    assert np.isnan(table["x"]).any()
    assert np.isnan(table["p1"]).any()
    assert np.isfinite(table["u1"]).all()


STATUS = """
#include "pneucli_controller.h"
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{
    static pneucli_controller c;
    pneucli_controller_status found;
    char line[512];
    double u[2];
    FILE *file = fopen(argv[argc - 1], "r");
    pneucli_controller_init(&c);
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        double value[5] = {0.0};
        char *rest = line;
        int i;
        for (i = 0; i < 5; ++i) {
            value[i] = strtod(rest, &rest);
            rest += *rest == ',';
        }
        if (value[4] > 0.0) {
            pneucli_controller_commission(&c, 5e-3, 1e6);
        }
        pneucli_controller_step(&c, value[0], value[1], value[2], value[3], u);
    }
    found = pneucli_controller_commissioned(&c);
    printf("%d %.17g %.17g %.17g %.17g %.17g %d %.17g %.17g\\n", found.state, found.null_1, found.null_2, found.delay,
           found.overshoot, found.gain, found.member, found.swing, found.swing_period);
    return 0;
}
"""


def test_the_c_tells_what_the_commissioning_found(tmp_path: Path) -> None:
    """On a machine with a hose of 10 ms and a null of 0.2 V, which the design does not know."""
    made = with_commissioning(
        MODEL, CONTROLLER, lambda m: design_cascade(m, axis.REQUIREMENTS, axis.SEALED), axis.BENCH
    )
    export_files.write_c_source(tmp_path, made, "demo")
    run = run_commissioning(
        with_time(MODEL, *added_times()[1], 10e-3).with_values({"valve.null": 0.2}), made, axis.BENCH
    )
    read = run.log[:, [layout.L_READ_X, layout.L_READ_P1, layout.L_READ_P2, layout.L_MODE]]
    np.savetxt(tmp_path / "log.csv", np.column_stack([run.scenario.reference, read]), delimiter=",", fmt="%.17g")
    (tmp_path / "status.c").write_text(STATUS)
    sources = [tmp_path / name for name in ("status.c", "pneucli_controller.c")]
    subprocess.run(["gcc", "-std=c99", *STRICT, *sources, "-lm", "-o", tmp_path / "status"], check=True)
    done = subprocess.run([tmp_path / "status", tmp_path / "log.csv"], check=True, capture_output=True, text=True)
    state, *figures = (float(word) for word in done.stdout.split())
    found = Commissioned(STATES[int(state)], *figures)  # type: ignore[arg-type]
    assert found == commissioned(run.states)
    assert found.state == "commissioned"
    assert found.delay == pytest.approx(12e-3, rel=0.1)
    assert found.null_1 == pytest.approx(0.2, abs=0.06)


def test_a_wrong_answer_would_be_found(folder: Path) -> None:
    text = (folder / export_files.REPLAY_FILE).read_text().splitlines()
    row = text[30_000].split(",")
    row[4] = repr(float(row[4]) + 1e-8)
    (folder / "wrong.csv").write_text("\n".join([*text[:30_000], ",".join(row), *text[30_001:]]) + "\n")
    done = subprocess.run([build(folder, "-O2"), folder / "wrong.csv"], check=False, capture_output=True)
    assert done.returncode == 1


@pytest.mark.parametrize("garbage", [math.nan, math.inf, -math.inf, 1e300, -1e300])
def test_no_reading_whatever_makes_a_command_that_is_not_one(folder: Path, garbage: float) -> None:
    """Each reading in turn is garbage from the first sample on; commands stay finite and within the valve's range."""
    rows = ["x_ref,x,p1,p2,u1,u2"]
    good = [0.1, 0.1, 3e5, 3e5]
    for place in range(4):
        for sample in range(50):
            values = list(good)
            if sample < 10 or sample > 30:
                values[place] = garbage
            rows.append(",".join(map(repr, [*values, 0.0, 0.0])).replace("inf", "INFINITY"))
    (folder / "garbage.csv").write_text("\n".join(rows) + "\n")
    done = subprocess.run([build(folder, "-O2"), folder / "garbage.csv"], check=False, capture_output=True, text=True)
    assert float(done.stdout.split()[1]) <= CONTROLLER.values["C_U_MAX"]


def test_matlab_reads_the_same_numbers(tmp_path: Path) -> None:
    export_files.write_mat(
        tmp_path / "design.mat", CONTROLLER, {"valve_inverse_area": export_files.inverse_table(CONTROLLER)}
    )
    found = loadmat(tmp_path / "design.mat", simplify_cells=True)
    assert found["controller"]["kp"] == CONTROLLER.values["C_KP"]
    assert np.array_equal(found["controller"]["fill"], CONTROLLER.fill)
    assert found["valve_inverse_area"]["u"].size == 2 * len(CONTROLLER.fill)


def test_the_inverse_of_a_second_valve_follows_that_of_the_first() -> None:
    alone = export_files.inverse_table(CONTROLLER.with_values(C_TWO_VALVES=0.0))
    assert "chamber" not in alone
    both = export_files.inverse_table(CONTROLLER.with_values(C_TWO_VALVES=1.0, C_AREA_FILL_2=3e-6))
    first = np.asarray(both["chamber"]) == 1.0
    assert np.array_equal(np.asarray(both["u"])[first], alone["u"])
    assert np.asarray(both["u"])[~first].tolist() == [*CONTROLLER.vent_2[::-1], *CONTROLLER.fill_2]
    assert np.asarray(both["area"])[-1] == 3e-6


def test_csv_is_read_back_to_the_last_bit(tmp_path: Path) -> None:
    export_files.write_csv(tmp_path / "controller.csv", export_files.controller_table(CONTROLLER))
    lines = (tmp_path / "controller.csv").read_text().splitlines()[1:]
    assert {k: float(v) for k, v in (line.split(",") for line in lines)} == dict(CONTROLLER.values)


def test_python_without_a_counterpart_is_refused() -> None:
    def loops(s, c):
        """Loops."""
        while s[0] < c[0]:
            s[0] = c[1]

    with pytest.raises(ValueError, match="no counterpart"):
        c_function(loops)


def test_the_replay_depends_on_the_sensors(tmp_path: Path) -> None:
    """The vectors hold what was read, not what was true: without noise they are others."""
    export_files.write_c(tmp_path / "quiet", CONTROLLER, MODEL, ClosedLoopSetup(), "demo")
    export_files.write_c(tmp_path / "noisy", CONTROLLER, MODEL, axis.BENCH, "demo")
    assert (tmp_path / "quiet" / export_files.REPLAY_FILE).read_text() != (
        tmp_path / "noisy" / export_files.REPLAY_FILE
    ).read_text()


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, PrecisionCost]:
    """A controller with a period of 4 ms: of a minute in single precision, Python calculates each sample."""
    path, slow = tmp_path_factory.mktemp("single"), axis.controller(replace(axis.REQUIREMENTS, period=4e-3))
    cost = export_files.write_c(path, slow, MODEL, axis.BENCH, "demo", "float32")
    assert cost is not None
    return path, cost


def test_in_single_precision_the_c_calculates_with_floats_alone(single: tuple[Path, PrecisionCost]) -> None:
    folder, _ = single
    source = (folder / "pneucli_controller.c").read_text() + (folder / "pneucli_controller.h").read_text()
    assert "double" not in source
    options = ["-std=c99", *STRICT, "-Wdouble-promotion", "-c", folder / "pneucli_controller.c", "-o", folder / "o.o"]
    subprocess.run(["gcc", *options], check=True)


def test_in_single_precision_it_gives_the_commands_that_were_foreseen(single: tuple[Path, PrecisionCost]) -> None:
    samples, worst, _, _ = replay(build(single[0], "-O2"), single[0])
    assert samples == 17_000
    assert worst <= 1e-9


def test_what_single_precision_costs_is_measured(single: tuple[Path, PrecisionCost]) -> None:
    """Of a range of 20 V; a decision that falls one sample earlier may cost all of it, in that sample."""
    _, off = single
    assert 0.0 < off.rms_v < off.p99_v < 0.1
    assert off.p99_v < off.largest_v <= 20.0


def test_the_minute_passes_through_hold_off_reset_and_a_supply_that_sags(folder: Path) -> None:
    table = np.genfromtxt(folder / export_files.REPLAY_FILE, delimiter=",", names=True)
    assert set(table["duty"]) == {0.0, 1.0, 2.0, 3.0, 5.0}
    assert np.ptp(table["supply"]) > 5e4
    assert np.all(table["u1"][:60_000][table["duty"][:60_000] == 2.0] == 0.0)
    reset = int(np.argmax(table["duty"] == 3.0))
    assert table["u1"][reset] == pytest.approx(table["u1"][reset - 1], rel=1e-12)


# --- the exported C commissions itself on the exam's rig while something is wrong: it names it and changes nothing


BY_ARRANGEMENT = {"valve stuck in its middle", "valve stuck open", "valve reversed", "supply lost"}
MAX_ERROR = 50e-6  # m, once the fault is gone


@cache
def rig(condition: str) -> tuple[Parameters, Controller]:
    return designed_rig(3, condition)


OTHERS = [(name, condition) for name in sorted(BY_ARRANGEMENT) for condition in ("5/3", "two-valves")]


@pytest.mark.parametrize(
    ("name", "condition"),
    [*((name, "usual") for name in FAULTS), *(pytest.param(*one, marks=[pytest.mark.slow]) for one in OTHERS)],
)
def test_a_fault_is_named_within_the_limits_and_the_gains_stay(name: str, condition: str, tmp_path: Path) -> None:
    par, made = rig(condition)
    write_c_source(tmp_path, made, "faults")
    found = commissioned_with(FAULTS[name], par, made, tmp_path)
    assert found.state in FAULTS[name].states
    assert found.unchanged == (found.state in SHUT)
    assert found.travel < 1.0
    assert found.pressure < 1.0
    assert found.error < MAX_ERROR
