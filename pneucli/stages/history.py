"""Earlier models: stored in the folder ``history`` of the stage, one folder a model.

A stage that is run anew takes the former models over as links, and the model that it replaces with them; a model that
comes back is not kept twice. So the history is whole or as before at every moment, as the stage's folder is.
"""

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pneucli.figure import read
from pneucli.messages.history import Model
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.graph import Context

FOLDER = "history"
ANSWER = "answer.json"
PARAMETER_DIGITS = 9  # of a parameter: what a fit repeats exactly, and another compiler's rounding does not change


@dataclass(frozen=True)
class ModelRecord:
    """One model: the answer of the stage to it, and the folder with the files that were kept of it."""

    answer: dict[str, Any]
    folder: Path
    current: bool

    @property
    def key(self) -> str:
        """Digest of what the model is and of the data that it was held against."""
        model = self.answer["model"]
        values = {name: f"{p['value']:.{PARAMETER_DIGITS}g}" for name, p in model.get("parameters", {}).items()}
        return staleness.digest([model["effects"], values, self.answer["data"], self.answer.get("excluded")])[:16]


def record_model(context: Context, answer: Mapping[str, Any], *artifacts: str) -> dict[str, Any]:
    """Take the former models of the stage that runs into its new folder; of each its answer and ``artifacts``.

    ``answer`` is the stage's answer to the model as it is. Returns what is to be added to it: its ``number`` in the
    history, and ``when`` it was there first.
    """
    now = ModelRecord(dict(answer), context.out, current=True)
    former = recorded_models(context.former) if context.former else []
    for one in former:
        if one.key != now.key and all((one.folder / name).is_file() for name in artifacts):
            _link_record(one, context.out / FOLDER / one.key, artifacts)
    again = next((one.answer for one in former if one.key == now.key), None)
    if again is not None:
        return {key: again[key] for key in ("number", "when")}
    number = 1 + max((one.answer["number"] for one in former), default=0)
    return {"number": number, "when": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")}


def recorded_models(folder: Path) -> list[ModelRecord]:
    """Return the models of a stage's folder, oldest first."""
    manifest = staleness.read_manifest(folder)
    files = sorted((folder / FOLDER).glob(f"*/{ANSWER}"))
    found = [ModelRecord(json.loads(one.read_text(encoding="utf-8")), one.parent, current=False) for one in files]
    if manifest is not None and manifest.answer is not None:
        found.append(ModelRecord(dict(manifest.answer), folder, current=True))
    return sorted((one for one in found if "number" in one.answer), key=lambda one: one.answer["number"])


def compared_models(folder: Path) -> list[Model]:
    """Return the models that ``history`` lists, oldest first."""
    found = [one.answer | {"current": one.current} | one.answer["model"] for one in recorded_models(folder)]
    return [read(Model, one) for one in found]


def _link_record(one: ModelRecord, folder: Path, files: tuple[str, ...]) -> None:
    folder.mkdir(parents=True)
    (folder / ANSWER).write_text(json.dumps(one.answer, indent=1, allow_nan=False), encoding="utf-8")
    for name in files:
        _link(one.folder / name, folder / name)


def _link(source: Path, target: Path) -> None:
    """Link a file that is never changed in place, which takes no room; copy it where there are no links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)
