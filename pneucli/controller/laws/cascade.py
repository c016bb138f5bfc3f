"""The law ``best``: the cascade with friction ahead, observers and release at rest."""

from pneucli.controller.cascade import cascade_step
from pneucli.controller.laws.base import ControlLaw

LAW = ControlLaw(
    "best",
    "cascade with friction ahead, observers, standstill",
    "7.1-7.3, 5.15-5.21",
    cascade_step,
    design=lambda data: {},  # the cascade is designed before the laws, which take it as their axis
    place=10,
    estimates_load=True,
)
