"""Volume in chamber 1 that the rig's description misses."""

from pneucli.physics.declaration import Effect, Parameter


def volume_1(volume_added: float) -> float:
    """Return the volume added to chamber 1: hoses, fittings, the bore of the end cap.

    Args:
        volume_added: Volume in m^3.

    Returns:
        The volume in m^3.

    References:
        Thesis (2.47) to (2.52): V01.

    >>> volume_1(2e-5)
    2e-05
    """
    return volume_added


EFFECT = Effect(
    name="dead-volume",
    title="Volume in chamber 1 that the rig's description misses",
    part="chamber",
    parameters=(
        Parameter(
            "volume_added",
            "m^3",
            0.0,
            "-0.9 dead volumes",
            "10 chamber volumes",
            ("0.1 chamber volumes", "0.3 chamber volumes"),
            "volume added to chamber 1",
        ),
    ),
    ports={"volume_1": volume_1},
    equation="$V_1 = V_{01} + V_{add} + A_1 x$",
    looks_like=("Every pressure gradient of chamber 1 is too small, by most where the chamber is small (near x = 0)."),
    shows_over="x",
    twins=("line-delay", "pressure-lag"),
    separate=("Charge the chamber at two positions of a held piston: the gradients' ratio gives the dead volume."),
    source="thesis 2.47-2.52",
)
