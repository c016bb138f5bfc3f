"""Play between command and opening."""

from pneucli.physics.declaration import Effect, Parameter, Untold


def command(u: float, s: float, h: float, half_width: float) -> tuple[float, float]:
    """Return the opening behind a play.

    Args:
        u: Command in V.
        s: State, the opening in V.
        h: Step in s.
        half_width: Half width of the play in V.

    Returns:
        Opening in V, and the new state.

    References:
        M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis (1989).

    >>> command(2.0, 0.0, 1e-3, 0.25), command(1.75, 1.75, 1e-3, 0.25)
    ((1.75, 1.75), (1.75, 1.75))
    """
    s = min(max(s, u - half_width), u + half_width)
    return s, s


EFFECT = Effect(
    name="valve-hysteresis",
    title="Play between command and opening",
    part="valve",
    parameters=(
        Parameter(
            "half_width",
            "V",
            0.0,
            0.0,
            "0.2 full commands",
            ("0.005 full commands", "0.02 full commands"),
            "half of the play",
            widens_overlap=True,
        ),
    ),
    ports={"command": command},
    equation="$s \\leftarrow \\min(\\max(s, u - w), u + w)$",
    looks_like=(
        "The same command gives less flow after rising and more after falling; the error has the sign of "
        "the last change."
    ),
    shows_over="u",
    twins=("valve-deadband", "valve-lag"),
    separate="A staircase up and down through the same commands, each held.",
    source="backlash (play) operator, Krasnosel'skii and Pokrovskii",
    untold=Untold(lambda rng, rig: {"half_width": rng.uniform(0.0, 0.01) * rig.max_command}),
)
