"""Does the valve's map predict a command that was not fitted? ``python -m benchmarks.valve_commands FOLDER...``

A folder holds cases with ``pipeline.toml`` and ``truth.json``. Each valve case is fitted with its true effects stated.
Then the recordings that hold one command are left out, one command after another, and the valve is fitted to the
others. A row has the error on fitted recordings, and that on the recordings left out: between fitted commands, and
beyond them (the smallest and the largest). Errors are in units of what a right model would show.
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import small
from benchmarks.cases import study_of
from benchmarks.truths import Truth, truth_of, truths
from pneucli.diagnose.adequacy import held_out_lack_of_fit, lack_of_fit_by_channel
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate import layout as at
from pneucli.stages.pipeline_data import PipelineData

MIN_HELD_SHARE = 0.3  # of a recording that holds one command
MIN_OPENING = 0.02  # of the largest command
MIN_SHARE_OF_OPEN = 0.9  # of the samples with an open valve
COMMAND_STEP = 0.05  # V between commands that count as different
AIM = 1.3  # times the error of the fitted recordings, or noise where that is larger
MIN_COMMANDS = 3  # so that one can be left out between two others


class Row(NamedTuple):
    """One command left out.

    ``command`` is its size in V, ``between`` whether fitted commands lie on both sides, the last two are errors.
    """

    case: str
    command: float
    between: bool
    fitted: float
    left_out: float


def held_command(residual_model: ResidualModel, null: float) -> float | None:
    """Return the size in V of the command that a recording holds while the valve is open; None for several sizes.

    A test that fills and vents holds one size in both directions.
    """
    opening = np.abs(residual_model.experiment.inputs[:, at.IN_U] - null)
    is_open = opening > MIN_OPENING * opening.max()
    levels, counts = np.unique(np.round(opening[is_open] / COMMAND_STEP), return_counts=True)
    if (
        not levels.size
        or counts.max() < MIN_HELD_SHARE * opening.size
        or counts.max() < MIN_SHARE_OF_OPEN * counts.sum()
    ):
        return None
    return float(COMMAND_STEP * levels[np.argmax(counts)])


def errors(
    study: PipelineData, train: Sequence[ResidualModel], left_out: Sequence[ResidualModel], effects: Sequence[str]
) -> tuple[float, float]:
    """Return the errors on fitted recordings and on those left out, of the model with the named effects."""
    guess = guess_base_model([v.experiment for v in train], study.rig, study.valve)
    found = fit_model(guess, train, (*study.effects, *(study.available_effects[name] for name in effects)))
    fitted, outside = lack_of_fit_by_channel(found.model, train), held_out_lack_of_fit(found, left_out)
    return max(r.ratio for r in fitted), max(r.ratio for r in outside)


def rows(case: Path, truth: Truth) -> Iterator[Row]:
    """Yield the commands of one case, each left out; none where the case has no test of a valve."""
    with tempfile.TemporaryDirectory() as out:
        study = study_of(case, Path(out), MAX_SAMPLES)
        models = [v for use in ("train", "test") for v in study.residual_models(use) if "p1" in v.channels]
        by_command: dict[float, list[ResidualModel]] = defaultdict(list)
        for one in models:
            if (command := held_command(one, study.rig.valve_null)) is not None:
                by_command[command].append(one)
        effects = [
            n for n in dict.fromkeys([*sorted(truth.hidden), *sorted(truth.mild)]) if n in study.available_effects
        ]
        for command, left_out in sorted(by_command.items()):
            if len(by_command) >= MIN_COMMANDS:
                train = [v for v in models if all(v is not one for one in left_out)]
                between = min(by_command) < command < max(by_command)
                yield Row(f"{case.parent.name} {case.name}", command, between, *errors(study, train, left_out, effects))


def table(folders: Sequence[Path]) -> None:
    """Print the errors of each command left out, and how many commands between others keep within 1.3."""
    seen: list[Row] = []
    print("| case | command (V) | fitted | left out | |")
    print("| --- | --- | --- | --- | --- |")
    for folder in folders:
        for case, truth in truths(folder):
            for row in rows(case, truth_of(truth)):
                seen.append(row)
                place = "between" if row.between else "outermost"
                print(
                    f"| {row.case} | {row.command:.2f} | {row.fitted:.2f} | {row.left_out:.2f} | {place} |", flush=True
                )
    for between in (True, False):
        mine = [r for r in seen if r.between == between]
        if mine:
            ratio = np.array([r.left_out / max(r.fitted, 1.0) for r in mine])
            print(
                f"{'between others' if between else 'outermost'}: {np.sum(ratio <= AIM)} of {ratio.size} at most "
                f"{AIM:g} times what is fitted, median {np.median(ratio):.2f}, largest {ratio.max():.2f}"
            )


def main(arguments: list[str]) -> None:
    """Leave the commands of every case out, one after another."""
    small.on_folders(arguments, table)


if __name__ == "__main__":
    main(sys.argv[1:])
