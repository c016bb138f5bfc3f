"""The simulation kernel: the state space of the thesis (2.47-2.52) with set-valued friction, one recording a call.

From the text of these files :mod:`pneucli.simulate.build` makes the compiled kernel: the functions of ``ports`` are the
ports (:data:`pneucli.physics.ports.PORTS`) without any effect and are replaced by the effects' own equations.
The files are also valid Python as they stand: the base model, slowly.

Scheme: the pressures take a midpoint step (one evaluation, extrapolated from the last one), the velocity a
trapezoidal step in which dry friction is a set: a piston that stops within a step stops exactly there, and holds
until the force exceeds what holds it. The command is held over a sample, measured inputs are interpolated.
"""
