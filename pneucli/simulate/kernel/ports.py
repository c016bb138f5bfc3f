"""The ports without any effect; :mod:`pneucli.simulate.build` puts the effects' equations in their place."""

from pneucli.physics.ports import PORTS

NEUTRAL = {"sum": 0.0, "factor": 1.0}  # of what effects are combined into; others map the first argument


def scalars(base, th, on):
    return base, th, on


def __getattr__(name):
    """Return a port, or whether an effect enters at one (``has_NAME``), without any effect."""
    if name.startswith("has_"):
        return lambda on: False
    if name not in PORTS:
        raise AttributeError(name)
    combine = PORTS[name].combine
    return lambda *given: NEUTRAL.get(combine, given[0])
