"""The catalogue of physical effects: every module here declares one as ``EFFECT``.

A user's own effect is the same declaration in a Python file that the pipeline file names (``[model] plugins``).
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from pneucli.errors import InputError, did_you_mean
from pneucli.physics.declaration import PORTS, Effect


@cache
def catalogue() -> dict[str, Effect]:
    """Return the effects that pneucli brings, by name."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return {m.EFFECT.name: m.EFFECT for m in modules}


def load_plugin(path: Path) -> Effect:
    """Return the effect that a user's Python file declares as ``EFFECT``; raises InputError where it does not."""
    spec = importlib.util.spec_from_file_location(f"pneucli_plugin_{path.stem}", path)
    if spec is None or spec.loader is None or not path.exists():
        raise InputError(f"{path}", "no such Python file", "a file that declares EFFECT = Effect(...)")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"{path}", f"it does not run: {error!r}", "a module that declares EFFECT") from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise InputError(f"{path}", "it declares no EFFECT", "EFFECT = pneucli.physics.declaration.Effect(...)")
    unknown = [port for port in effect.ports if port not in PORTS]
    if unknown:
        raise InputError(f"{path}", f'unknown port "{unknown[0]}"', mend=did_you_mean(unknown[0], PORTS))
    return effect


def all_effects(plugins: Iterable[Path] = ()) -> dict[str, Effect]:
    """Return the catalogue and the user's own effects, by name, in the order of names."""
    own = [load_plugin(path) for path in plugins]
    return dict(sorted((catalogue() | {e.name: e for e in own}).items()))


def select(names: Iterable[str], known: dict[str, Effect], where: str = "[model] effects") -> tuple[Effect, ...]:
    """Return the named effects; raises InputError with the closest name for one that is not known."""
    chosen = []
    for name in names:
        if name not in known:
            raise InputError(where, f'unknown effect "{name}"', mend=did_you_mean(name, known))
        chosen.append(known[name])
    return tuple(chosen)
