"""Synthesis of the control laws, each by its own file: from the data of an axis to the controller of each law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.design_data import DesignData
from pneucli.errors import InputError


def controller_for(law: str, data: DesignData) -> Controller:
    """Design the controller of one law.

    Args:
        law: A key of ``LAWS``.
        data: The design data of the axis.

    Raises:
        InputError: The data lack what the law needs, or there is no such law.

    """
    found = LAWS[law].design(data)
    common = {n: v for n, v in found.items() if n in layout.PARAMETERS and not isinstance(v, tuple)}
    own = np.concatenate([[], *(np.atleast_1d(found[name]) for name in LAWS[law].parameters)])
    assert set(found) == {*common, *LAWS[law].parameters}
    return data.cascade.with_law(law, common, tuple(map(float, own)))


def design_controllers(
    data: DesignData, names: Iterable[str] = tuple(LAWS)
) -> tuple[dict[str, Controller], dict[str, str]]:
    """Design several laws.

    Returns:
        The controllers by name of the law, and for each law that cannot be designed the reason.

    """
    made, failed = {}, {}
    for name in names:
        try:
            made[name] = controller_for(name, data)
        except InputError as error:
            failed[name] = f"{error.where}: {error.found}"
    return made, failed


def design_variants(data: DesignData, names: Iterable[str]) -> dict[str, Controller]:
    """Design the variants of the given laws that the requirements do not select, for comparison.

    Returns:
        Controllers by the name of the variant, such as ``relay, switching``.

    """
    found: dict[str, Controller] = {}
    for name in names:
        for title, choice in LAWS[name].variants.items():
            changed = replace(data.requirements, **choice)
            if changed != data.requirements:
                made, _ = design_controllers(replace(data, requirements=changed), [name])
                found |= {f"{name}, {title}": controller for controller in made.values()}
    return found
