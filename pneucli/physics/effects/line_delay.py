"""Delay in the hoses between valve and chambers."""

from pneucli.physics.declaration import Effect, Parameter, Untold


def flow_delay(delay: float, bore: float) -> float:
    """Return the time by which the flow of the valve arrives later in a chamber.

    Args:
        delay: Delay in s.
        bore: Inner diameter of the hose in m, or 0.

    Returns:
        The delay in s.

    >>> flow_delay(3e-3, 0.0)
    0.003
    """
    return delay


def hose_bore(delay: float, bore: float) -> float:
    """Return the inner diameter of the hose, with which it has volume, inertia and friction.

    Args:
        delay: Delay in s.
        bore: Inner diameter in m; 0: the flow is delayed and no more.

    Returns:
        The diameter in m; 0 without a delay, since a hose without a length has nothing of this.

    >>> hose_bore(3e-3, 4e-3), hose_bore(0.0, 4e-3)
    (0.004, 0.0)
    """
    return bore if delay > 0.0 else 0.0


EFFECT = Effect(
    name="line-delay",
    title="Delay in the hose between valve and chamber",
    part="line",
    parameters=(
        Parameter(
            "delay",
            "s",
            0.0,
            0.0,
            "1 horizons",
            ("0.01 response times", "0.03 response times"),
            "delay: length over speed of sound",
            direct="delay",
        ),
        Parameter(
            "bore",
            "m",
            None,
            "0.5 valve bores",
            "20 valve bores",
            ("2.5 valve bores",),
            "inner diameter of the hose",
            refines=True,
            unrefined=0.0,
        ),
    ),
    ports={"flow_delay": flow_delay, "hose_bore": hose_bore},
    equation=(
        "$q_i(t) = q_{valve,i}(t - \\tau)$; with a bore $D$, a length $L = c \\tau$ and $A = \\pi D^2 / 4$: "
        "$\\frac{A L}{2 c^2} \\dot p_{valve} = q_{valve} - q$, $\\frac{L}{A} \\dot q = p_{valve} - p_i - \\Delta p(q)$"
    ),
    looks_like=(
        "The error stands where the command changes fast, proportional to the change of flow: the "
        "measured pressure follows later, then at the right slope."
    ),
    shows_over="u",
    twins=("valve-lag", "time-skew", "pressure-lag"),
    separate=(
        "Step the command and record the pressure at 10 kHz: a dead time starts late and sharp, a lag "
        "starts at once and soft."
    ),
    source=(
        "speed of sound in the hose, length / 343 m/s and more; with a bore a section of a transmission line: Richer "
        "and Hurmuzlu, ASME J. DSMC 122 (2000)"
    ),
    untold=Untold(lambda rng, rig: {"delay": rng.uniform(0.0, 1e-3)}),
)
