"""Standstill: how the controller frees a piston that sticks off a resting reference, and when it holds it.

Source: own, docs/closed-loop.md shows what it does on a machine; friction is that of thesis (3.6), gas of (2.14).

State chart (state variable in brackets; "at rest": of the reference, :func:`reference_rests`)::

    TRACKING   the reference moves: release force 0, ramp gain 4, dead-band gain 1, loop gain 1
      -> HOLD                at rest, |v| of the model and as seen < C_V_FLOOR and |error| < C_HOLDING_BAND x dead-band
                             gain; one that stands, < C_MOTION_STEP in C_MOTION_WINDOW: < 1.65 C_HOLDING_BAND
      -> RAMP or ELASTIC     at rest and outside that band, by [S_ELASTIC]
    a bumpless start within 2 C_HOLDING_BAND of the reference begins in HOLD (active_reference in operation.py)
    HOLD       [S_HOLD = 1] force frozen, valves shut while the pressures stay within C_PRESSURE_BAND, no lead of the
               spool; after 10 C_MOTION_WINDOW at rest in it the gain of the pressure loops is at most 20 1/s
      entry: the load is limited to what friction can hold, half of the net force is released (rigid piston only),
      release force 0, the time at rest begins anew
      -> TRACKING, RAMP or ELASTIC   |v| >= C_V_FLOOR, the reference moves, or |error| > 1.8 x band (hysteresis)
      after 10 C_MOTION_WINDOW at rest [S_REST_TIME]: ramp gain back to 4, a dead band no wider than the error asks
    rigid piston [S_ELASTIC = 0]: breakaway_ramp
      RAMP     the release force [S_RELEASE_FORCE] rises: fast up to 92 % of the last break-away force, then slowly;
               it stops where the pressures are saturated
        error changes its sign: ramp gain x 0.5 (>= 0.1); once below 1 also dead-band gain x 1.5
                                (<= C_DEADBAND_GAIN_MAX)
        -> SLIDING   motion is detected [S_MOVING_COUNT > 0] in the direction of the release force
      SLIDING  first sample after a rest of more than 0.5 C_MOTION_WINDOW: record break-away force and position
        -> BRAKING   error - stopping distance < 2 C_MOTION_STEP: release force 0, timer C_MOTION_WINDOW
                     [S_BRAKING_TIME]
        else slower than C_CLOSING_RATE x error: integrate the error
      BRAKING  the timer runs down
        -> RAMP      at its end adapt_after_overshoot: a jump past the reference that half the ramp rate did not
                     shorten by 30 % widens the dead band by up to a half, toward half that jump, or to it where the
                     error was turned round rather than reduced
                     in a loop found later than designed [S_DELAY_FOUND, S_MEMBER]: one that lands far off sets the
                     ramp gain to 0.5, and after more the dead band is half of the shorter of two
    elastic piston [S_ELASTIC = 1]: drive_elastic_piston and braking_force
      entered  at rest, excursion > 2 C_MOTION_STEP under a peak force < 0.5 Coulomb friction; out of HOLD
               while the air's force rises along it by 1.5 Coulomb friction in C_PRESLIDING_DISTANCE (detect_motion)
      left     excursion or error > C_PRESLIDING_DISTANCE (loop gain back to 1); for good [-1] until the reference
               moves, where the air's force changes by Coulomb friction and the piston stays within C_MOTION_STEP
      PRESSURES LAG  keep the force          STICKING  the force grows exponentially [S_FORCE_RAMP]
      RETURNING      unload the ramp         MOVING    integrate the predicted stopping error
      each reversal after > 2 C_MOTION_STEP: loop gain x 0.7 (>= 0.05); each overshoot: dead-band gain x 1.5
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import (
    clamp,
    dry_friction_factor,
    is_held_for_good,
    max_pressure_reference,
    net_force,
    pressure_force,
    sign,
    speed_after,
)
from pneucli.controller.valve_dynamics import (
    chamber_volume_1,
    chamber_volume_2,
    gas_stiffness_1,
    gas_stiffness_2,
    valve_gradient_1,
    valve_gradient_2,
)


def reference_rests(s):
    """Whether the reference has been at rest for 50 ms: of the state chart, and an end of what motion alone tells."""
    return s[S_REF_REST_TIME] > 0.05


def detect_motion(force, s, c):
    """Detect whether the piston moves, and whether it is elastic: it moves under a force that friction must hold.

    A rigid piston starts, and reverses, only under more than dry friction. An excursion longer than the presliding
    distance is sliding, whatever is elastic; one out of HOLD along which the air's force does not rise, as even the
    softest seal asks, is of a load. A piston that stands while the air's force changes by dry friction is rigid: late
    pressures had shown too small a force as it slid. ``force`` is the net force in N without friction.
    """
    s[S_ANCHOR] += (s[S_X] - s[S_ANCHOR]) * min(c[C_PERIOD] / c[C_MOTION_WINDOW], 1.0)
    s[S_MOVING_COUNT] = s[S_MOVING_COUNT] + 1.0 if math.fabs(s[S_X] - s[S_ANCHOR]) > 0.25 * c[C_MOTION_STEP] else 0.0
    if s[S_MOVING_COUNT] < 0.5:
        s[S_REST_TIME] += c[C_PERIOD]
    elif s[S_MOVING_COUNT] > 1.5:
        s[S_REST_TIME] = 0.0
    if s[S_EXCURSION] * s[S_V] <= 0.0:
        if s[S_ELASTIC] > 0.5 and reference_rests(s) and math.fabs(s[S_EXCURSION]) > 2.0 * c[C_MOTION_STEP]:
            s[S_LOOP_GAIN] = max(0.7 * s[S_LOOP_GAIN], 0.05)
        s[S_EXCURSION] = 0.0
        s[S_PEAK_FORCE] = 0.0
        s[S_FIRST_FORCE] = force - s[S_LOAD]
        s[S_FROM_HOLD] = s[S_HOLD]
    s[S_EXCURSION] += c[C_PERIOD] * s[S_V]
    s[S_PEAK_FORCE] = max(s[S_PEAK_FORCE], force * sign(s[S_V]))
    friction = c[C_COULOMB] * dry_friction_factor(s[S_X], s[S_V], s, c)
    bent = (force - s[S_LOAD] - s[S_FIRST_FORCE]) * sign(s[S_EXCURSION]) * c[C_PRESLIDING_DISTANCE]
    loaded = s[S_FROM_HOLD] > 0.5 and bent < 1.5 * friction * math.fabs(s[S_EXCURSION])
    held = s[S_PEAK_FORCE] < 0.5 * friction and not loaded
    if not reference_rests(s):
        s[S_ELASTIC] = max(s[S_ELASTIC], 0.0)
    elif held and s[S_ELASTIC] > -0.5 and math.fabs(s[S_EXCURSION]) > 2.0 * c[C_MOTION_STEP]:
        s[S_ELASTIC] = 1.0
    if math.fabs(s[S_X] - s[S_STILL_X]) > c[C_MOTION_STEP]:
        s[S_STILL_X] = s[S_X]
        s[S_STILL_FORCE] = force - s[S_LOAD]
    elif s[S_ELASTIC] > 0.5 and math.fabs(force - s[S_LOAD] - s[S_STILL_FORCE]) > friction:
        s[S_ELASTIC] = -1.0
        s[S_LOOP_GAIN] = 1.0
    if math.fabs(s[S_EXCURSION]) > c[C_PRESLIDING_DISTANCE] or (
        reference_rests(s) and math.fabs(s[S_X_SHAPED] - s[S_X]) > c[C_PRESLIDING_DISTANCE]
    ):
        s[S_ELASTIC] = min(s[S_ELASTIC], 0.0)
        s[S_LOOP_GAIN] = 1.0


def load_observable(s):
    """Whether the residual of the motion is a load: not while friction or elastic seals may carry a piston at rest."""
    if not reference_rests(s):
        return True
    return s[S_MOVING_COUNT] > 0.5 and s[S_ELASTIC] < 0.5


def sector_switching_term(error, rate, c):
    """Return the switching term of the sector, -1 to 1: mean sign of both lines, continuous between them (5.13)."""
    s1 = rate + c[C_SECTOR_1] * error
    s2 = rate + c[C_SECTOR_2] * error
    total = math.fabs(s1) + math.fabs(s2)
    return (s1 + s2) / total if total > 0.0 else 0.0


def air_stiffness(s, c):
    """Return the stiffness of the enclosed gas in N/m at the time when a command arrives."""
    x = s[S_PREDICTED_X]
    return c[C_GAMMA] * (gas_stiffness_1(x, c) * s[S_PREDICTED_P1] + gas_stiffness_2(x, c) * s[S_PREDICTED_P2])


def max_unloading_rate(direction, s, c):
    """Return the rate in N/s at which fully open valves change the pressure force toward ``direction``.

    Not below the rate of the pressure level: near ambient or supply pressure there is no force left to release.
    """
    nodes: int = int(c[C_TABLE_NODES])
    first: int = C_TABLE + nodes - 1 if direction > 0.0 else C_TABLE + 2 * nodes - 1
    second: int = first
    if c[C_TWO_VALVES] > 0.5:
        second = C_TABLE + 4 * nodes - 1 if direction > 0.0 else C_TABLE + 3 * nodes - 1
    rate_1 = valve_gradient_1(c[first], s[S_PREDICTED_P1], chamber_volume_1(s[S_PREDICTED_X], c), s, c)
    rate_2 = valve_gradient_2(c[second], s[S_PREDICTED_P2], chamber_volume_2(s[S_PREDICTED_X], c), s, c)
    return max(math.fabs(c[C_AREA_1] * rate_1 - c[C_AREA_2] * rate_2), c[C_AREA_1] * c[C_LEVEL_RATE])


def net_force_at_arrival(s, c):
    """Return the net force in N without friction at the time when a command arrives."""
    return net_force(s[S_PREDICTED_X], s[S_PREDICTED_P1], s[S_PREDICTED_P2], s, c)


def stopping_distance(s, c):
    """Return the distance in m that the piston still travels if the net force is released as fast as possible.

    The release starts when a command arrives. The pressure loop, the spool, the opening of the valves and the
    expansion of the gas limit its rate.
    """
    force = net_force_at_arrival(s, c)
    max_rate = max_unloading_rate(-force, s, c)
    stiffness = air_stiffness(s, c)
    h = 0.1 / c[C_P_KP] + 0.1 * math.fabs(force) / max_rate
    loop_share = min(h * c[C_P_KP], 1.0)
    spool_share = h / (h + c[C_PERIOD] * (1.0 / c[C_SPOOL_SHARE] - 1.0))
    opening = 0.0
    v = s[S_PREDICTED_V]
    distance = s[S_PREDICTED_X] - s[S_X]
    for i in range(40):  # noqa: B007 - structured text has no names that begin with _
        opening += spool_share * (1.0 - opening)
        limit = h * opening * max_rate
        released = clamp(loop_share * force, -limit, limit)
        next_v = speed_after(s[S_PREDICTED_X], v, force - 0.5 * released, h, s, c)
        limit += stiffness * math.fabs(0.5 * h * (v + next_v))  # the gas expands with the piston's motion
        released = clamp(loop_share * force, -limit, limit)
        next_v = speed_after(s[S_PREDICTED_X], v, force - 0.5 * released, h, s, c)  # mean force of the step
        distance += 0.5 * h * (v + next_v)
        v = next_v
        force -= released
    return distance


def widen_dead_band(swing, s, c):
    """Widen the dead band to half of a ``swing`` (m) about a resting reference: the piston stays where it is."""
    s[S_DEADBAND_GAIN] = max(s[S_DEADBAND_GAIN], 0.5 * swing / c[C_HOLDING_BAND])


def widen_by_half(s, c):
    """Widen the dead band by half up to its limit; one that is wider, for a swing, stays."""
    s[S_DEADBAND_GAIN] = max(s[S_DEADBAND_GAIN], min(1.5 * s[S_DEADBAND_GAIN], c[C_DEADBAND_GAIN_MAX]))


def adapt_after_overshoot(error, s, c):
    """Widen the dead band toward half of a jump past the reference that half the ramp rate did not shorten.

    In a loop that a commissioning found later than designed no ramp shortens it, since a freed piston goes on until
    the valve answers: the ramp slows down at once, and after two long jumps half of the shorter one is near enough.
    """
    if s[S_BRAKING_TIME] <= 0.0 or s[S_BRAKING_TIME] > c[C_PERIOD]:
        return
    jump = math.fabs(s[S_X] - s[S_BREAKAWAY_POSITION])
    last = s[S_LAST_JUMP]
    if jump <= math.fabs(error):
        return
    s[S_LAST_JUMP] = jump
    far = 4.0 * c[C_DEADBAND_GAIN_MAX] * c[C_HOLDING_BAND]
    if s[S_DELAY_FOUND] > 0.0 and s[S_MEMBER] > 1.5:
        if s[S_RAMP_GAIN] < 0.5 and min(jump, last) > 2.0 * far:
            widen_dead_band(min(jump, last), s, c)
        if math.fabs(error) > max(far, 0.5 * (jump - math.fabs(error))):
            s[S_RAMP_GAIN] = min(s[S_RAMP_GAIN], 0.5)
    if s[S_RAMP_GAIN] < 0.5 and jump > 0.7 * last:
        # as far past the reference as it was before it, once more: this goes on for ever; a longer one is of a load
        if math.fabs(error) > 0.4 * jump and jump < 2.0 * last:
            widen_dead_band(jump, s, c)
        s[S_DEADBAND_GAIN] = clamp(
            0.5 * jump / c[C_HOLDING_BAND],
            s[S_DEADBAND_GAIN],
            max(s[S_DEADBAND_GAIN], min(1.5 * s[S_DEADBAND_GAIN], c[C_DEADBAND_GAIN_MAX])),
        )


def is_force_saturated(error, s, c):
    """Whether the pressure references are at the limits that bound the force toward the reference."""
    two = c[C_TWO_VALVES] > 0.5
    if error > 0.0:
        return s[S_P1_REF] >= max_pressure_reference(s, c) and (not two or s[S_P2_REF] <= c[C_P_LOW])
    return s[S_P1_REF] <= c[C_P_LOW] and (not two or s[S_P2_REF] >= max_pressure_reference(s, c))


def slow_down_after_overshoot(error, s, c):
    """Halve the ramp rate at each change of the error's sign; from the third overshoot on also widen the dead band."""
    if error * s[S_LAST_SIGN] < 0.0:
        # at a tenth the force rises by 4 % of break-away in 15 ms: slower, jumps are no shorter, reversals take seconds
        s[S_RAMP_GAIN] = max(0.5 * s[S_RAMP_GAIN], 0.1)
        if s[S_RAMP_GAIN] < 1.0:
            widen_by_half(s, c)
    s[S_LAST_SIGN] = sign(error)


def drive_sliding_piston(error, factor, s, c):
    """Record the break-away force, then brake near the reference, or integrate the error of a piston that creeps."""
    if s[S_MOVING_COUNT] == 1.0 and s[S_REST_TIME] > 0.5 * c[C_MOTION_WINDOW]:
        force = net_force(s[S_X], s[S_P1], s[S_P2], s, c)
        s[S_BREAKAWAY_FORCE] = clamp(math.fabs(force) / factor, 0.5 * c[C_STATIC], c[C_BREAKAWAY_MAX])
        s[S_BREAKAWAY_POSITION] = s[S_X]
    if (error - stopping_distance(s, c)) * sign(s[S_RELEASE_FORCE]) < 2.0 * c[C_MOTION_STEP]:
        s[S_RELEASE_FORCE] = 0.0
        s[S_BRAKING_TIME] = c[C_MOTION_WINDOW]
    elif math.fabs(s[S_V]) < c[C_CLOSING_RATE] * math.fabs(error):
        increment = c[C_PERIOD] * clamp(c[C_MASS] * c[C_KI] * error, -c[C_RAMP_RATE_MAX], c[C_RAMP_RATE_MAX])
        s[S_RELEASE_FORCE] = clamp(s[S_RELEASE_FORCE] + increment, -c[C_RELEASE_FORCE_MAX], c[C_RELEASE_FORCE_MAX])


def breakaway_ramp(error, s, c):
    """Set the release force in N of a rigid piston that sticks off a resting reference (state chart above).

    The release force adds to the load estimate. It rises fast up to a little below the last break-away force, then
    slowly. Near the reference it is released and friction stops the piston. Overshoots slow the ramp down and widen
    the dead band, so that an unmodelled effect cannot sustain a limit cycle.
    """
    factor = max(dry_friction_factor(s[S_X], error, s, c), 0.1)
    slow_down_after_overshoot(error, s, c)
    if s[S_MOVING_COUNT] > 0.5 and s[S_BRAKING_TIME] <= 0.0 and s[S_RELEASE_FORCE] * s[S_V] > 0.0:
        drive_sliding_piston(error, factor, s, c)
        return
    adapt_after_overshoot(error, s, c)
    s[S_BRAKING_TIME] -= c[C_PERIOD]
    if s[S_BRAKING_TIME] > 0.0 or is_force_saturated(error, s, c):
        return
    direction = sector_switching_term(error, -s[S_V], c)
    rate = c[C_RAMP_RATE_MAX]
    if net_force_at_arrival(s, c) * sign(error) >= factor * max(0.92 * s[S_BREAKAWAY_FORCE], 0.7 * c[C_STATIC]):
        rate = min(c[C_RAMP_RATE_PER_ERROR] * math.fabs(error), c[C_RAMP_RATE_MAX])
    rate = max(rate * min(s[S_RAMP_GAIN], 1.0), c[C_RAMP_RATE_MIN])
    s[S_RELEASE_FORCE] = clamp(
        s[S_RELEASE_FORCE] + c[C_PERIOD] * rate * direction, -c[C_RELEASE_FORCE_MAX], c[C_RELEASE_FORCE_MAX]
    )


def enter_hold(s, c):
    """Hold the piston where it sticks; release half of the net force unless the piston is elastic.

    Friction holds it, so that no more than friction is net force: what exceeds it is an error of the load estimate,
    which would push the piston off once its release force is gone.
    """
    s[S_HOLD] = 1.0
    s[S_REST_TIME] = 0.0
    s[S_FORCE] = pressure_force(s, c)
    if s[S_ELASTIC] < 0.5:
        net = net_force(s[S_X], s[S_P1], s[S_P2], s, c)
        held = clamp(net, -c[C_STATIC], c[C_STATIC])
        s[S_LOAD] -= net - held
        s[S_FORCE] -= 0.5 * held
        s[S_RELEASE_FORCE] = 0.0
    s[S_FORCE_RAMP] = 0.0


def update_hold(x_ref, s, c):
    """Enter or leave the state HOLD at a reference x_ref (m); return whether the piston is held.

    One that stands within the tolerance is held: a correction might go farther. One that slides where the model has
    it stick is not: its friction is less than the model's, and half of the force would keep it sliding.
    """
    resting = reference_rests(s) and max(math.fabs(s[S_V]), math.fabs(s[S_V_SEEN])) < c[C_V_FLOOR]
    error = math.fabs(x_ref - s[S_X])
    band = c[C_HOLDING_BAND] * s[S_DEADBAND_GAIN]
    stands = math.fabs(s[S_V]) * c[C_MOTION_WINDOW] < c[C_MOTION_STEP]
    # 0.825 of the tolerance, let go at 0.9: of 10 counts, no whole number, at which a log's rounding would decide
    near = max(band, 1.65 * c[C_HOLDING_BAND]) if stands else band
    if s[S_HOLD] < 0.5 and resting and error < near:
        enter_hold(s, c)
    elif not resting or error > 1.8 * band:
        s[S_HOLD] = 0.0
    elif is_held_for_good(s, c):  # the next motion has a new cause
        s[S_RAMP_GAIN] = 4.0
        s[S_DEADBAND_GAIN] = clamp(error / c[C_HOLDING_BAND], 1.0, s[S_DEADBAND_GAIN])
        s[S_LAST_JUMP] = 0.0
    return s[S_HOLD] > 0.5


def pressure_loop_lags(s, c):
    """Whether the pressure error exceeds break-away: then the force is not raised further."""
    return c[C_AREA_1] * math.fabs(s[S_P1_REF] - s[S_P1]) > c[C_STATIC]


def drive_elastic_piston(error, s, c):
    """Set the release force in N of an elastic piston off a resting reference (state chart above).

    The error at the predicted stop drives it; each overshoot widens the dead band, so that no limit cycle persists.
    """
    stopping_error = error - s[S_V] / c[C_CLOSING_RATE]
    if error * s[S_LAST_SIGN] < 0.0:
        widen_by_half(s, c)
        s[S_FORCE_RAMP] = 0.0
    s[S_LAST_SIGN] = sign(error)
    rate = c[C_ELASTIC_RATE] * math.fabs(stopping_error)
    if pressure_loop_lags(s, c):
        rate = 0.0
    elif s[S_MOVING_COUNT] < 0.5:
        rate = max(rate, c[C_RAMP_GROWTH_RATE] * s[S_FORCE_RAMP])
        rate = max(rate, 2.0 * c[C_STATIC])
        s[S_FORCE_RAMP] = min(s[S_FORCE_RAMP] + c[C_PERIOD] * rate, c[C_RELEASE_FORCE_MAX])
    elif stopping_error * s[S_V] < 0.0 and s[S_FORCE_RAMP] > 0.0:
        rate = max(rate, c[C_UNLOADING_RATE] * s[S_FORCE_RAMP])
        s[S_FORCE_RAMP] = max(s[S_FORCE_RAMP] - c[C_PERIOD] * rate, 0.0)
    else:
        s[S_FORCE_RAMP] = 0.0
    s[S_RELEASE_FORCE] = clamp(
        s[S_RELEASE_FORCE] + c[C_PERIOD] * rate * sign(stopping_error),
        -c[C_RELEASE_FORCE_MAX],
        c[C_RELEASE_FORCE_MAX],
    )


def braking_force(error, s, c):
    """Return the force in N that brakes an elastic piston: proportional to its speed above the closing speed."""
    excess_speed = s[S_V] - c[C_CLOSING_RATE] * error
    if excess_speed * s[S_V] <= 0.0:
        return 0.0
    limit = 2.0 * c[C_COULOMB] * dry_friction_factor(s[S_X], s[S_V], s, c)
    return -clamp(c[C_BRAKE_DAMPING] * excess_speed, -limit, limit)
