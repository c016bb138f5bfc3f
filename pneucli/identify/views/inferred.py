"""The balance of forces where no sensor reads p2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pneucli.identify.views.chambers import Chambers
from pneucli.identify.views.forces import Forces
from pneucli.identify.views.view import Array
from pneucli.physics.declaration import Side
from pneucli.simulate.model import Model
from pneucli.simulate.unread import with_settled_p2


@dataclass(frozen=True)
class Inferred(Forces):
    """Mechanics with the p2 that the model of gas and valve has for the measured motion and commands.

    What was in chamber 2 at the start is not known: it is what leaves least of the force. While the gas stays shut in,
    it acts like a spring of unknown preload, so that part of such a force cannot be told from it.
    """

    sides: ClassVar[frozenset[Side]] = Forces.sides | Chambers.sides
    base: ClassVar[frozenset[str]] = Forces.base | Chambers.base

    def known(self, model: Model, inputs: Array) -> Array:
        """Return inputs (n, 8) with the model's p2."""
        return with_settled_p2(model, self.experiment, inputs)
