"""``[model]`` of the pipeline file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pneucli.config.sizes import Table
from pneucli.config.values import Name


class ParameterTable(Table):
    """One entry of ``[model.parameters]``: what is known beforehand, as text with a unit, or in SI."""

    fixed: str | float | None = None
    start: str | float | None = None
    min: str | float | None = None
    max: str | float | None = None
    sigma: str | float | None = None

    @model_validator(mode="after")
    def _says_something(self) -> ParameterTable:
        others = [key for key in ("start", "min", "max", "sigma") if getattr(self, key) is not None]
        if self.fixed is None and not others:
            raise ValueError("nothing is said of it; wanted fixed, or start, min, max and sigma")
        if self.fixed is not None and others:
            raise ValueError(f"what is fixed has no {others[0]}; leave one of them out")
        return self


class ModelTable(Table):
    """``[model]``: effects on top of the base model, the valve's form, what is known of parameters beforehand, and
    Python files with effects of one's own.
    """

    effects: list[str] = Field(default_factory=list)
    valve: Literal["map", "linear"] = "map"
    parameters: dict[str, ParameterTable] = Field(default_factory=dict)
    plugins: list[Name] = Field(default_factory=list)
