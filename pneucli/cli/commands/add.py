"""``add``: add effects to the model, identify again, show the error before and after."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneucli.cli.command import Command, File, HowToRun
from pneucli.errors import InputError
from pneucli.figure import Figure, read
from pneucli.messages import StageAnswer, labelled, table
from pneucli.messages.compare import Answer, LackOfFit, next_command
from pneucli.messages.formatting import format_noise_ratio, format_parameters, join_names

if TYPE_CHECKING:
    from pneucli.stages.diff import ErrorChange

HELP = "Add effects to [model], identify anew, show the error before and after."
Effects = Annotated[list[str] | None, typer.Argument(metavar="EFFECT", help="Names of effects.")]
Suggested = Annotated[bool, typer.Option("--suggested", help="What the diagnosis names, in its order.")]


@dataclass(frozen=True)
class Edit(StageAnswer):
    """What adding or removing effects did: the error before and after, of the model and of each recording."""

    effects: Sequence[str]
    added: Sequence[str]
    removed: Sequence[str]
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]
    lack_of_fit: LackOfFit | None
    recordings: Sequence[ErrorChange]
    parameters: Mapping[str, Figure]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield what was changed, the error before and after, each recording, and what to do next."""
        changes = {"added": self.added, "removed": self.removed}
        changed = " and ".join(f"{word} {join_names(names)}" for word, names in changes.items() if names)
        yield from labelled("changed", f"{changed or 'nothing'}; effects: {join_names(self.effects) or 'none'}")
        yield from labelled("error", self._error())
        if self.parameters:
            yield from labelled("size", format_parameters(self.parameters))
        yield from table(("recording", "use", "before", "after, × noise"), [r.row for r in self.recordings], texts=2)
        yield from labelled("do", f"pneucli {next_command(self.lack_of_fit, self.after)} {file}")

    def _error(self) -> str:
        """Return the error before and after on test recordings, and on those that were fitted."""
        parts = [
            f"{format_noise_ratio(self.before[use])} → {format_noise_ratio(self.after[use])} × noise on {name}"
            for use, name in {"test": "test recordings", "train": "those fitted"}.items()
            if self.after.get(use) is not None
        ]
        return ", ".join(parts) or "nothing was compared"


def _add(pipeline: File, effects: Effects = None, suggested: Suggested = False, how: HowToRun = HowToRun()) -> None:
    from pneucli.config import load, plugin_files
    from pneucli.physics.effects import all_effects, select_effects

    if not effects and not suggested:
        raise InputError(
            "pneucli add", "no effect", "names of effects, or --suggested", "pneucli effects lists them", code="E001"
        )
    config = load(pipeline)
    chosen = [
        *(effects or []),
        *(how.update(how.open(pipeline), "diagnose")["diagnose"].answer["missing"] if suggested else []),
    ]
    select_effects(chosen, all_effects(plugin_files(config)))
    change_effects(pipeline, list(dict.fromkeys([*config.model.effects, *chosen])), how)


def change_effects(file: Path, effects: list[str], how: HowToRun) -> None:
    """Write the effects into the file; print the error of the model before and after."""
    from pneucli.config.effect_edit import set_effects

    before = how.update(how.open(file), "compare")["compare"].answer
    present = before["model"]["effects"]
    if effects != present:
        set_effects(file, effects)
    after = how.update(how.open(file), "compare")["compare"].answer
    how.tell(_edit(read(Answer, before), read(Answer, after)), file)
    if how.verbose and not how.json:
        how.show("compare", after, file)


def _edit(before: Answer, after: Answer) -> Edit:
    from pneucli.stages.diff import error_changes

    was, now = before.model.effects, after.model.effects
    added = [name for name in now if name not in was]
    return Edit(
        schema="pneucli/edit/1",
        pipeline=after.pipeline,
        effects=now,
        added=added,
        removed=[name for name in was if name not in now],
        before=before.error,
        after=after.error,
        lack_of_fit=after.lack_of_fit,
        recordings=error_changes(before.channels, after.channels),
        parameters={n: p for n, p in after.model.parameters.items() if n.partition(".")[0] in added},
    )


COMMAND = Command(_add, "pneucli add axis-7/pipeline.toml --suggested", HELP, place=110)
