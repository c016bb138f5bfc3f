"""Dead times of a switching valve, one to open and one to close."""

from pneucli.physics.declaration import Effect, Parameter

WAIT = 1e-9  # of the state per s while a shut valve waits: far below any command, from which the state starts


def switched(position: float, s: float, h: float, open: float, close: float) -> tuple[float, float]:
    """Return the mean position of a switching valve over a step.

    Its coil must charge before the armature leaves, and discharge before the spring brings it back. A command that is
    taken back before that has no effect. From one way to the other, filling begins as the valve opens and venting as it
    closes: the coil of a 3/2 or 5/2 valve with a spring is on in one of them.

    Args:
        position: Commanded position: 1 fills, 0 is shut, -1 vents.
        s: State: away from 0 while the valve is open, its sign that of the position; +-(1 + time in s) while it waits
            to leave an open position, -position ``WAIT`` times the time while it waits to leave the shut one.
        h: Step in s.
        open: Time in s from the command until the valve opens.
        close: Time in s from the command until it closes.

    Returns:
        Mean position, and the state after the step.

    >>> place, state = switched(1.0, 0.0, 0.01, 0.025, 0.03)
    >>> place, state = switched(1.0, state, 0.01, 0.025, 0.03)
    >>> place, [round(value, 3) for value in switched(1.0, state, 0.01, 0.025, 0.03)]
    (0.0, [0.5, 1.0])
    """
    is_open = abs(s) >= WAIT * 1e3  # a shut valve waits for less than 1000 s
    before = 0.0
    waited = 0.0
    if is_open:
        before = 1.0 if s > 0.0 else -1.0
        waited = max(abs(s) - 1.0, 0.0)
    elif s * position < 0.0:
        waited = abs(s) / WAIT
    if before == position:
        return position, position
    delay = open if position > 0.0 or (position < 0.0 and before == 0.0) else close
    left = delay - waited
    if left >= h:
        if is_open:
            return before, before * (1.0 + waited + h)
        return before, -position * WAIT * (waited + h)
    share = max(left, 0.0) / h
    return before * share + position * (1.0 - share), position


# s, of small solenoid valves made for pulses (data sheets: 1 to 8 ms); longer ones let no pulse of theirs pass
FAST_OPENING, FAST_CLOSING = 0.004, 0.006

EFFECT = Effect(
    name="switching-time",
    title="Dead times of a switching valve",
    part="switching valve",
    parameters=(
        Parameter(
            "open",
            "s",
            0.0,
            0.0,
            "1 horizons",
            ("0.02 response times", "0.05 response times", FAST_OPENING),
            "from the command until it opens",
        ),
        Parameter(
            "close",
            "s",
            0.0,
            0.0,
            "1 horizons",
            ("0.03 response times", "0.08 response times", FAST_CLOSING),
            "from the command until it closes",
        ),
    ),
    ports={"switched": switched},
    equation=(
        "open $\\tau_o$ after the command to open, shut $\\tau_c$ after the command to close; a shorter command has "
        "no effect"
    ),
    looks_like=(
        "After each command the pressure goes on as before, then takes the right slope at once; a pulse lasts longer "
        "or shorter than its command."
    ),
    shows_over="u",
    twins=("line-delay", "time-skew"),
    separate="Single pulses of several lengths: a hose delays both edges alike, and a short pulse still arrives.",
    source="switching times on and off of data sheets; ISO 12238 (shifting time)",
)
