"""A wiper on the rod: while the rod comes back it scrapes, the harder the further out the rod stands."""

from pneucli.physics.declaration import Effect, Parameter

REACH = 0.05  # m of rod over which the wiper fills up


def filled(x: float) -> float:
    """Return how full the wiper is, 0 to 1, at position x in m."""
    return min(max(x / REACH, 0.0), 1.0)


def dry_factor(direction: float, x: float, p1: float, p2: float, p_amb: float, gain: float) -> float:
    """Return the factor on dry friction: while the rod comes back, and the wiper is full."""
    if direction < 0.0:
        return 1.0 + gain * filled(x)
    return 1.0


EFFECT = Effect(
    name="rod-wiper",
    title="Wiper that scrapes on the way back",
    part="cylinder",
    parameters=(Parameter("gain", "1", 0.0, 0.0, 5.0, (0.2, 1.0), "rise of dry friction on the way back, wiper full"),),
    ports={"dry_factor": dry_factor},
    equation="dry friction × $(1 + g \\min(x / 50\\,\\mathrm{mm}, 1))$ while $v < 0$",
    looks_like="The model moves back too easily, and the more so the further out the rod is.",
    shows_over="x",
    twins=("friction-asymmetry", "position-friction"),
    separate="Drive back slowly from 20 mm and from 150 mm: with a wiper only the second sticks.",
    source="own measurement",
)
