"""Play between command and opening."""

from pneucli.physics.declaration import Effect, Parameter


def command(u: float, s: float, h: float, half_width: float) -> tuple[float, float]:
    """Opening in V behind a play of the given half width."""
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
)
