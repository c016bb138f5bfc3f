"""The catalogue of physical effects: every module here declares one as ``EFFECT``, and so does each entry point of the
group ``pneucli.effects`` in other packages.

A plugin is the same declaration in a Python file of the user, which the pipeline file names (``[model] plugins``).
"""

import importlib
import importlib.util
import keyword
import linecache
import pkgutil
import traceback
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import get_args

from pneucli import imports
from pneucli.errors import InputError, did_you_mean, require_known
from pneucli.experiments import Part
from pneucli.physics.declaration import Effect
from pneucli.physics.equations import EquationError, check_effect
from pneucli.physics.ports import PORTS
from pneucli.physics.sides import with_variants


@cache
def catalogue() -> dict[str, Effect]:
    """Return the effects of the catalogue by name.

    Returns:
        Every effect that a module of this package declares, or an entry point of another one.

    Raises:
        InputError: Another package's effect cannot be loaded, or the kernel cannot compile it.

    >>> catalogue()["stribeck"].title
    'Stribeck friction'
    """
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    found = {m.EFFECT.name: m.EFFECT for m in modules}
    for name, point in imports.entry_points(imports.EFFECTS).items():
        effect = imports.load(point)
        _check_effect(effect, f"entry point {name} of {imports.EFFECTS}", found)
        found[effect.name] = effect
    return found


@cache
def catalogue_with_sides() -> dict[str, Effect]:
    """Return the catalogue with the variants of its effects at either side, by name.

    Returns:
        Effects by name.

    >>> catalogue().keys() < catalogue_with_sides().keys()
    True
    """
    return with_variants(catalogue().values())


def with_catalogue(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return the catalogue with its variants and these effects, each name once: what one compiled kernel holds.

    Args:
        effects: Effects of the catalogue, their variants, or plug-ins.

    Returns:
        Effects; a plug-in takes the place of an effect of the same name.

    >>> with_catalogue([catalogue()["stribeck"]]) == tuple(catalogue_with_sides().values())
    True
    """
    return tuple({**catalogue_with_sides(), **{effect.name: effect for effect in effects}}.values())


def load_plugin(path: Path) -> Effect:
    """Load the effect that a Python file of the user declares as ``EFFECT``.

    Args:
        path: The file.

    Returns:
        The effect, checked: the kernel can compile it.

    Raises:
        InputError: The file is missing or fails, declares no effect, takes a name of the catalogue, or has a function
            that the kernel cannot compile.

    >>> load_plugin(Path("missing.py"))
    Traceback (most recent call last):
    pneucli.errors.InputError: missing.py: no such Python file [E002]
      wanted: a file that declares EFFECT = Effect(...)
    """
    spec = importlib.util.spec_from_file_location(f"pneucli_plugin_{path.stem}", path)
    if spec is None or spec.loader is None or not path.exists():
        raise InputError(f"{path}", "no such Python file", "a file that declares EFFECT = Effect(...)", code="E002")
    module = importlib.util.module_from_spec(spec)
    linecache.checkcache(str(path))  # the text of its functions is that of the file as it is now
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        line = next(
            (f.lineno for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename == str(path)), 0
        )
        where = f"{path}, line {line}" if line else f"{path}"
        raise InputError(where, f"it does not run: {error!r}", "a module that declares EFFECT", code="E028") from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise InputError(
            f"{path}", "it declares no EFFECT", "EFFECT = pneucli.physics.declaration.Effect(...)", code="E028"
        )
    _check_effect(effect, f"{path}", catalogue())
    return effect


def _check_effect(effect: Effect, where: str, known: Mapping[str, Effect]) -> None:
    """Raise InputError for a name that is known, an unknown part or port, or an equation that cannot be compiled."""
    if effect.name in known:
        raise InputError(where, f'"{effect.name}" is an effect of the catalogue', "a name of its own", code="E028")
    parts = get_args(Part)
    if effect.part not in parts:
        raise InputError(where, f'unknown part "{effect.part}"', mend=did_you_mean(effect.part, parts), code="E028")
    unknown = [port for port in effect.ports if port not in PORTS]
    if unknown or not effect.ports:
        found = f'unknown port "{unknown[0]}"' if unknown else "it enters at no port"
        raise InputError(where, found, mend=did_you_mean(unknown[0] if unknown else "", PORTS), code="E028")
    for p in effect.parameters:
        if not p.name.isidentifier() or keyword.iskeyword(p.name):
            raise InputError(where, f'"{p.name}" is no name of a parameter', "letters, digits and _", code="E028")
    try:
        check_effect(effect)
    except EquationError as fault:
        raise InputError(where, fault.found, fault.wanted, "see docs/own-effect.md", code="E028") from fault


def all_effects(plugins: Iterable[Path] = ()) -> dict[str, Effect]:
    """Return the catalogue, plugins and the variants of both at either side, in the order of names.

    Args:
        plugins: Python files, each with one effect.

    Returns:
        Effects by name.

    Raises:
        InputError: As :func:`load_plugin`.

    >>> list(all_effects()) == sorted(catalogue_with_sides())
    True
    """
    own = [load_plugin(path) for path in plugins]
    return dict(sorted((catalogue_with_sides() | with_variants(own)).items()))


def select_effects(
    names: Sequence[str], available: dict[str, Effect], where: str = "[model] effects"
) -> tuple[Effect, ...]:
    """Return effects by their names.

    Args:
        names: Names of effects.
        available: Effects by name.
        where: The place of the names in the pipeline file, for the message.

    Returns:
        The effects in the order of ``names``.

    Raises:
        InputError: A name is unknown; the message gives the closest one.

    >>> [effect.title for effect in select_effects(["stribeck"], catalogue())]
    ['Stribeck friction']
    """
    require_known(names, available, where, 'unknown effect "{}"', code="E030")
    return tuple(available[name] for name in names)
