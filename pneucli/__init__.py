"""pneucli: from recordings of a servo-pneumatic axis to models, the missing effect, and a validated controller.

>>> import pneucli                                             # doctest: +SKIP
>>> run = pneucli.open("artifacts/axis-7")                     # doctest: +SKIP
>>> run.ladder, run.valve.dp_dt(u=2.0, p=4e5)                  # doctest: +SKIP
>>> pneucli.simulate(run, u=command, p_supply=7e5)             # doctest: +SKIP
>>> pneucli.diagnose(run).missing                              # doctest: +SKIP

``simulate`` and ``diagnose`` are also the packages of that name: what is imported from them is found as ever.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from pneucli.version import __version__

__all__ = ["InputError", "Run", "__version__", "diagnose", "from_arrays", "open", "simulate"]

if TYPE_CHECKING:
    from pneucli.errors import InputError
    from pneucli.notebook.arrays import diagnose, from_arrays
    from pneucli.notebook.run import Run
    from pneucli.notebook.run import open_run as open
    from pneucli.notebook.simulation import simulate

_LAZY_NAMES = {
    "InputError": ("pneucli.errors", "InputError"),
    "Run": ("pneucli.notebook.run", "Run"),
    "open": ("pneucli.notebook.run", "open_run"),
    "from_arrays": ("pneucli.notebook.arrays", "from_arrays"),
}
_CALLABLE_PACKAGES = {"simulate": "pneucli.notebook.simulation", "diagnose": "pneucli.notebook.arrays"}


class _CallablePackage(ModuleType):
    """A package of which one function bears the name, too: calling the package calls the function."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        name = self.__name__.rpartition(".")[2]
        return getattr(import_module(_CALLABLE_PACKAGES[name]), name)(*arguments, **named)


class _LazyPackage(ModuleType):
    """The package itself: names are found when they are first used, so that importing it takes no time."""

    def __getattr__(self, name: str) -> Any:
        if name in _CALLABLE_PACKAGES:
            return import_module(f"pneucli.{name}")
        if name not in _LAZY_NAMES:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        module, inner = _LAZY_NAMES[name]
        return getattr(import_module(module), inner)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _CALLABLE_PACKAGES and isinstance(value, ModuleType):  # the import system binds the package here
            value.__class__ = _CallablePackage
            value.__doc__ = f"{value.__doc__}\n\nCalled, it is the function {_CALLABLE_PACKAGES[name]}.{name}."
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})


sys.modules[__name__].__class__ = _LazyPackage
