"""Commissioning on the machine: null of the valves, delay and gain of the pressure loop, and a watch for limit cycles.

A relay on the pressure (Astrom and Hagglund 1984) changes it by so little that friction holds the piston. While the
pressure approaches the edge of the band its slopes tell rate and null; how long it takes to come back tells the delay,
and how far it overshoots tells a delay, which overshoots at full rate, from a lag, which does not.

State chart (S_COMMISSIONING)::

    0 as designed; limit cycles are watched for if there is a family of gains
      -> 1  commission
      -> 5  a limit cycle at rest
    1 SHUT     the valves are shut for 0.3 s; then the limits count from here
      -> 2  all readings are there, with little noise
    2 RELAY 1  the relay fills and vents chamber 1 (a 5/3 spool: also chamber 2 the other way)
      no reversal: twice the rate, up to 8 times
      -> 3  after 10 to 22 half cycles with two valves, else -> 4
    3 RELAY 2  likewise chamber 2
      -> 4  after 10 to 22 half cycles
    4 RUNNING  nulls are shifted, the member of the family of gains is that whose delay is nearest; limit cycles are
               watched for
      -> 5  a limit cycle at rest
    5 SLOWER   the member of the family for the next longer delay, each time
      -> 6  a limit cycle with the longest
    6 CYCLING  the dead band is half of the swing until the reference moves
    a limit cycle slower than what the loop does is one of a piston that sticks between: the dead band alone is widened
    valves shut, gains and nulls unchanged, until the controller is disabled (then 0, or 4 after an earlier success):
    10 STOPPED      disabled while the test ran           11 TRAVEL     the piston reached its limit
    12 PRESSURE     a pressure reached its limit          13 SILENT     no reversal of the pressure
    14 SENSOR LOST  a reading is missing                  15 NOISY      a reading is too noisy
    16 AGAINST      as 11 to 13, where the pressure went the other way than the relay drives it
    17 OTHER        the pressure changes at less than half, or more than twice, the rate of the model
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import (
    clamp,
    drive_mirrored_valve,
    is_held_for_good,
    is_plausible,
    valve_command,
    valve_command_2,
)
from pneucli.controller.standstill import widen_dead_band
from pneucli.controller.valve_dynamics import (
    chamber_volume_1,
    chamber_volume_2,
    null_command_1,
    null_command_2,
    valve_gradient_1,
    valve_gradient_2,
)


def commission(travel, pressure, s, c):
    """Begin the commissioning within limits of travel (m) and pressure (Pa) from the start; 0: as designed."""
    if s[S_DISABLED] > 0.5:
        return
    s[S_TRAVEL_LIMIT] = travel if travel > 0.0 else c[C_TRAVEL_LIMIT]
    s[S_PRESSURE_LIMIT] = pressure if pressure > 0.0 else c[C_PRESSURE_LIMIT]
    s[S_LOST_COUNT] = 0.0
    s[S_NULL_SHIFT1] = 0.0
    s[S_NULL_SHIFT2] = 0.0
    s[S_RELAY_TIME] = 0.0
    enter(1.0, s)


def enter(state, s):
    """Enter a state of the chart (no unit); a fault forgets what a first valve's test found."""
    s[S_COMMISSIONING] = state
    s[S_COMMISSIONING_TIME] = 0.0
    if state > 9.5:
        s[S_NULL_SHIFT1] = 0.0
        s[S_NULL_SHIFT2] = 0.0


def stop_commissioning(s):
    """End a running test, or a state in which the valves stay shut, as the controller is disabled."""
    if s[S_COMMISSIONING] > 0.5 and s[S_COMMISSIONING] < 3.5:
        enter(10.0, s)
    elif s[S_COMMISSIONING] > 9.5:
        enter(4.0 if s[S_DELAY_FOUND] > 0.0 else 0.0, s)


def shut_valves(s, c):
    """Command the null of each valve in V."""
    s[S_STARTED] = 0.0
    s[S_U1] = null_command_1(c) + s[S_NULL_SHIFT1]
    s[S_U2] = null_command_2(c) + s[S_NULL_SHIFT2] if c[C_TWO_VALVES] > 0.5 else 0.0


def relay_reading(p1, p2, s, c):
    """Return the pressure in Pa that the relay switches: p1, p2, or with one spool their difference by the areas."""
    if s[S_COMMISSIONING] > 2.5:
        return p2
    return p1 - c[C_AREA_2] / c[C_AREA_1] * p2 if c[C_MIRRORED] > 0.5 else p1


def relay_gradient(u, s, c):
    """Return the rate in Pa/s of that pressure by the model under a command u (V), where the test began."""
    if s[S_COMMISSIONING] > 2.5:
        return valve_gradient_2(u, s[S_START_P2], chamber_volume_2(s[S_START_X], c), s, c)
    rate = valve_gradient_1(u, s[S_START_P1], chamber_volume_1(s[S_START_X], c), s, c)
    if c[C_MIRRORED] > 0.5:
        second = valve_gradient_2(u, s[S_START_P2], chamber_volume_2(s[S_START_X], c), s, c)
        rate -= c[C_AREA_2] / c[C_AREA_1] * second
    return rate


def relay_command(way, s, c):
    """Return the command in V that fills (``way`` 1) or vents (-1) at the rate of the relay by the model."""
    rate = way * c[C_RELAY_RATE] * s[S_RELAY_WIDTH]
    if s[S_COMMISSIONING] > 2.5:
        return valve_command_2(rate, s[S_START_P2], chamber_volume_2(s[S_START_X], c), s, c)
    if c[C_MIRRORED] > 0.5:
        drive_mirrored_valve(rate, s[S_START_X], s[S_START_P1], s[S_START_P2], s, c)
        return s[S_U1]
    return valve_command(rate, s[S_START_P1], chamber_volume_1(s[S_START_X], c), s, c)


def begin_relay(state, p1, p2, s, c):
    """Begin the relay test of a valve in its state of the chart, from the readings p1, p2 (Pa)."""
    enter(state, s)
    s[S_RELAY_WIDTH] = 1.0
    s[S_RELAY_PRESSURE] = relay_reading(p1, p2, s, c)
    s[S_RELAY_SIGN] = 1.0
    s[S_RELAY_INSIDE] = 1.0
    begin_counting(s)


def begin_counting(s):
    """Clear the sums of the relay test."""
    s[S_RELAY_TIME] = 0.0
    s[S_RELAY_COUNT] = 0.0
    s[S_RELAY_PEAK] = 0.0
    clear_sums(s)


def clear_sums(s):
    """Clear the sums over half cycles."""
    s[S_TIME_OUTSIDE] = 0.0
    s[S_TIME_UP] = 0.0
    s[S_TIME_DOWN] = 0.0
    s[S_PEAKS_UP] = 0.0
    s[S_PEAKS_DOWN] = 0.0


def within_limits(x, p1, p2, s, c):
    """Check the readings x (m), p1, p2 (Pa) against the limits; enter the state that names a fault.

    The limits act at half of the travel and at 0.8 of the pressure, so that the piston, and the gas that is on its
    way, end within them. A reading may be missing for 5 samples.
    """
    if not (
        is_plausible(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE])
        and is_plausible(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY])
        and is_plausible(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY])
    ):
        s[S_LOST_COUNT] += 1.0
        if s[S_LOST_COUNT] > 5.5:
            enter(14.0, s)
        return False
    s[S_LOST_COUNT] = 0.0
    if s[S_COMMISSIONING] < 1.5:
        return True
    if math.fabs(x - s[S_START_X]) > 0.5 * s[S_TRAVEL_LIMIT]:
        give_up(11.0, p1, p2, s, c)
    elif max(math.fabs(p1 - s[S_START_P1]), math.fabs(p2 - s[S_START_P2])) > 0.8 * s[S_PRESSURE_LIMIT]:
        give_up(12.0, p1, p2, s, c)
    return s[S_COMMISSIONING] < 9.5


def relay_progress(p1, p2, s, c):
    """Return by how much in Pa the pressure is from its start toward where the relay drives it, from p1, p2 (Pa)."""
    return s[S_RELAY_SIGN] * (relay_reading(p1, p2, s, c) - relay_reading(s[S_START_P1], s[S_START_P2], s, c))


def give_up(state, p1, p2, s, c):
    """Enter the state of a fault, or that of a pressure (p1, p2 in Pa) that went the wrong way by more than the band.

    Once back from a reversal (``S_RELAY_INSIDE``) it can be there by a valve that is reversed or stuck, or without air.
    """
    progress = relay_progress(p1, p2, s, c)
    enter(state, s)
    if s[S_RELAY_INSIDE] > 0.5 and progress < -c[C_RELAY_BAND]:
        enter(16.0, s)


def settle(x, p1, p2, s, c):
    """Run a sample with the valves shut: the readings x (m), p1, p2 (Pa) become the start, unless they are too noisy.

    Over the last 0.2 s of 0.3 s the rms of the steps must be below the tolerance for x, and below the relay's band over
    3.5 for the pressures: more noise takes more from the delay, 1.2 ms, than half of what lies between two members of
    the family. Noise of x turns back from sample to sample, a piston that moves by a null that is off does not.
    """
    step = x - s[S_START_X]
    change = 3.5 * max(math.fabs(p1 - s[S_START_P1]), math.fabs(p2 - s[S_START_P2])) / c[C_RELAY_BAND]
    noise = max(-0.5 * step * s[S_START_STEP] / (c[C_HOLDING_BAND] * c[C_HOLDING_BAND]), change * change)
    if s[S_COMMISSIONING_TIME] > 0.1:
        s[S_RELAY_TIME] += c[C_PERIOD] * min(noise, 9.0)
    s[S_START_STEP] = step
    s[S_START_X] = x
    s[S_START_P1] = p1
    s[S_START_P2] = p2
    if s[S_COMMISSIONING_TIME] > 0.3:
        if s[S_RELAY_TIME] > 0.2:
            enter(15.0, s)
        else:
            begin_relay(2.0, p1, p2, s, c)


def advance_relay(p1, p2, s, c):
    """Advance the relay by a sample with the readings p1, p2 (Pa); sums run from the third half cycle on.

    Without a reversal 0.05 s after the relay switched, or a switch in 0.25 s, the relay asks for twice the rate.
    """
    h = c[C_PERIOD]
    s[S_RELAY_PRESSURE] += min(h / 2e-3, 1.0) * (relay_reading(p1, p2, s, c) - s[S_RELAY_PRESSURE])
    off = s[S_RELAY_SIGN] * (s[S_RELAY_PRESSURE] - relay_reading(s[S_START_P1], s[S_START_P2], s, c))
    s[S_RELAY_TIME] += h
    peak = s[S_RELAY_PEAK]
    if s[S_RELAY_INSIDE] < 0.5:
        s[S_TIME_OUTSIDE] += h
        s[S_RELAY_PEAK] = max(s[S_RELAY_PEAK], -off - c[C_RELAY_BAND])
        if off > 0.0:
            s[S_RELAY_INSIDE] = 1.0
            if s[S_RELAY_SIGN] > 0.0:
                s[S_PEAKS_DOWN] += s[S_RELAY_PEAK]
            else:
                s[S_PEAKS_UP] += s[S_RELAY_PEAK]
    elif off > c[C_RELAY_BAND]:
        s[S_RELAY_SIGN] = -s[S_RELAY_SIGN]
        s[S_RELAY_INSIDE] = 0.0
        s[S_RELAY_TIME] = 0.0
        s[S_RELAY_PEAK] = 0.0
        s[S_RELAY_COUNT] += 1.0
        if s[S_RELAY_COUNT] < 2.5:
            clear_sums(s)
    elif s[S_RELAY_SIGN] > 0.0:
        s[S_TIME_UP] += h
    else:
        s[S_TIME_DOWN] += h
    if s[S_RELAY_TIME] > 0.25 or (s[S_RELAY_TIME] > 0.05 and s[S_RELAY_PEAK] > peak):
        s[S_RELAY_WIDTH] *= 2.0
        begin_counting(s)
        if s[S_RELAY_WIDTH] > 8.5:
            give_up(13.0, p1, p2, s, c)
    elif s[S_COMMISSIONING_TIME] > 4.0:  # ten half cycles of 0.25 s, after three that were too slow
        give_up(17.0, p1, p2, s, c)


def relay_is_complete(s):
    """Whether the relay just switched at the end of a cycle after 22 half cycles, or 10 and 1.5 s."""
    if s[S_RELAY_TIME] > 0.0 or s[S_RELAY_SIGN] < 0.0:
        return False
    return s[S_RELAY_COUNT] > 21.5 or (s[S_RELAY_COUNT] > 9.5 and s[S_COMMISSIONING_TIME] > 1.5)


def null_shift(s, c):
    """Return by how much in V the null is off: both measured rates are then the same multiple of those of the model."""
    up = relay_command(1.0, s, c)
    down = relay_command(-1.0, s, c)
    low = -0.95 * (up - down)
    high = 0.95 * (up - down)
    for halved in range(30):  # 2^-30 of the range  # noqa: B007 - structured text: no names that begin with _
        middle = 0.5 * (low + high)
        # the slope upwards goes by 1 / S_TIME_UP, that downwards by 1 / S_TIME_DOWN
        if (
            s[S_TIME_DOWN] * relay_gradient(down - middle, s, c) + s[S_TIME_UP] * relay_gradient(up - middle, s, c)
            > 0.0
        ):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def evaluate_relay(s, c):
    """Evaluate a relay test, without its first two half cycles: null, delay, overshoot; return the gain.

    The slopes are those of the second half of the band, past which a lag has decayed. A pressure that reverses after a
    delay L is before it for L (2 + q + 1 / q) + T_up + T_down in a cycle, q = T_down / T_up. The longer delay of two
    valves counts; of the gains the first.
    """
    cycles = 0.5 * (s[S_RELAY_COUNT] - 2.0)
    up = max(s[S_TIME_UP] / cycles, c[C_PERIOD])
    down = max(s[S_TIME_DOWN] / cycles, c[C_PERIOD])
    delay = (s[S_TIME_OUTSIDE] / cycles - up - down) / (2.0 + down / up + up / down)
    overshoot = 0.5 * (s[S_PEAKS_UP] / cycles * up + s[S_PEAKS_DOWN] / cycles * down) / c[C_RELAY_BAND]
    shift = null_shift(s, c)
    gain = c[C_RELAY_BAND] / up / max(relay_gradient(relay_command(1.0, s, c) - shift, s, c), 1.0)
    if s[S_COMMISSIONING] > 2.5:
        s[S_NULL_SHIFT2] = shift
    else:
        s[S_NULL_SHIFT1] = shift
        s[S_DELAY_TESTED] = 0.0
        s[S_OVERSHOOT_TESTED] = 0.0
        s[S_GAIN_TESTED] = gain
    if delay > s[S_DELAY_TESTED]:
        s[S_DELAY_TESTED] = delay
        s[S_OVERSHOOT_TESTED] = overshoot
    return gain


def shift_table(shift, table: int, c):
    """Add ``shift`` (V) to the commands of an inverse table up to its last, the end of the range."""
    nodes: int = int(c[C_TABLE_NODES])
    first = c[table] + shift
    last = c[table + nodes - 1]
    for i in range(nodes - 1):
        c[table + i] = clamp(c[table + i] + shift, min(first, last), max(first, last))


def set_nulls(s, c):
    """Shift the null of each valve by what the test found."""
    nodes: int = int(c[C_TABLE_NODES])
    second = s[S_NULL_SHIFT2] if c[C_TWO_VALVES] > 0.5 else s[S_NULL_SHIFT1]
    shift_table(s[S_NULL_SHIFT1], C_TABLE, c)
    shift_table(s[S_NULL_SHIFT1], C_TABLE + nodes, c)
    shift_table(second, C_TABLE + 2 * nodes, c)
    shift_table(second, C_TABLE + 3 * nodes, c)
    s[S_NULL_FOUND1] += s[S_NULL_SHIFT1]
    s[S_NULL_FOUND2] += s[S_NULL_SHIFT2]
    s[S_NULL_SHIFT1] = 0.0
    s[S_NULL_SHIFT2] = 0.0


def member_row(member, c):
    """Return where a member of the family begins among the parameters, by its number from 1 on."""
    return c[C_FAMILY] + c[C_FAMILY_WIDTH] + (member - 1.0) * (c[C_FAMILY_WIDTH] + 2.0)


def nearest_member(s, c):
    """Return the member of the family, from 1 on, whose delay and overshoot are nearest to those found; or 0."""
    best = 0.0
    least = 1e9
    for i in range(int(c[C_FAMILY_MEMBERS])):
        row: int = int(member_row(i + 1.0, c))
        off = c[row] - s[S_DELAY_FOUND]
        over = c[row + 1] - s[S_OVERSHOOT_FOUND]
        if off * off + over * over < least:
            least = off * off + over * over
            best = i + 1.0
    return best


def set_member(member, s, c):
    """Set the gains to those of a member of the family, by its number from 1 on; 0 leaves them as they are."""
    if member < 0.5:
        return
    s[S_MEMBER] = member
    width: int = int(c[C_FAMILY_WIDTH])
    row: int = int(member_row(member, c)) + 2
    for i in range(width):
        place: int = int(c[int(c[C_FAMILY]) + i])
        c[place] = c[row + i]


def finish_relay(p1, p2, s, c):
    """End the relay test of a valve: begin that of the other, or apply what was found, from p1, p2 (Pa)."""
    gain = evaluate_relay(s, c)
    if gain < 0.5 or gain > 2.0:
        enter(17.0, s)
        return
    if s[S_COMMISSIONING] < 2.5 and c[C_TWO_VALVES] > 0.5:
        begin_relay(3.0, p1, p2, s, c)
        return
    s[S_DELAY_FOUND] = s[S_DELAY_TESTED]
    s[S_OVERSHOOT_FOUND] = s[S_OVERSHOOT_TESTED]
    s[S_GAIN_FOUND] = s[S_GAIN_TESTED]
    set_nulls(s, c)
    set_member(nearest_member(s, c), s, c)
    enter(4.0, s)
    s[S_SWING_COUNT] = 0.0
    s[S_RESET_PHASE] = 2.0


def run_commissioning(x, p1, p2, s, c):
    """Run a sample of the chart with readings x (m), p1, p2 (Pa); return whether it has the valves, by its commands."""
    s[S_COMMISSIONING_TIME] += c[C_PERIOD]
    if s[S_COMMISSIONING] > 9.5:
        shut_valves(s, c)
        return True
    if s[S_COMMISSIONING] < 0.5 or s[S_COMMISSIONING] > 3.5:
        return False
    if not within_limits(x, p1, p2, s, c):
        shut_valves(s, c)
        return True
    if s[S_COMMISSIONING] < 1.5:
        settle(x, p1, p2, s, c)
    else:
        advance_relay(p1, p2, s, c)
        if relay_is_complete(s):
            finish_relay(p1, p2, s, c)
    shut_valves(s, c)
    if s[S_COMMISSIONING] > 1.5 and s[S_COMMISSIONING] < 2.5:
        s[S_U1] = relay_command(s[S_RELAY_SIGN], s, c)
    elif s[S_COMMISSIONING] > 2.5 and s[S_COMMISSIONING] < 3.5:
        s[S_U2] = relay_command(s[S_RELAY_SIGN], s, c)
    return True


def watch_limit_cycle(x, s, c):
    """Watch x (m), as read, for a limit cycle at a resting reference, commissioned or not; back off if there is one.

    Four half swings of more than twice the tolerance, all within a factor of two, are one: a load that comes and goes
    makes three, a loop with a damping of 0.1 loses half in three. Those of the first second at rest do not count, and
    what moves a piston that was held for good has a new cause. The estimate may swing about a piston that stands.
    """
    if c[C_FAMILY_MEMBERS] < 0.5 or not is_plausible(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        return
    s[S_SWING_TIME] += c[C_PERIOD]
    if s[S_REF_REST_TIME] < 1.0 or is_held_for_good(s, c):
        s[S_SWING_EDGE] = x
        s[S_SWING_PEAK] = x
        s[S_SWING_COUNT] = 0.0
        s[S_SWING_TIME] = 0.0
        return
    reach = s[S_SWING_PEAK] - s[S_SWING_EDGE]
    if (x - s[S_SWING_PEAK]) * reach > 0.0 or reach == 0.0:
        s[S_SWING_PEAK] = x
    if math.fabs(x - s[S_SWING_PEAK]) > 4.0 * c[C_HOLDING_BAND]:
        count_half_swing(x, s)
        if s[S_SWING_COUNT] > 3.5:
            back_off(s, c)


def slower_member(s, c):
    """Return the member, from 1 on, of the next longer delay; one more than there are if there is none.

    Delays are the last members, the longer after the shorter. Gains for a delay hold a lag as well; those for a lag
    lead the spool, and swing with a delay.
    """
    now: int = int(member_row(max(s[S_MEMBER], 1.0), c))
    found = c[C_FAMILY_MEMBERS] + 1.0
    least = 1e9
    for i in range(int(c[C_FAMILY_MEMBERS])):
        member = c[C_FAMILY_MEMBERS] - i
        row: int = int(member_row(member, c))
        if found - member < 1.5 and c[row] > c[now] and c[row] < least:
            found = member
            least = c[row]
    return found


def back_off(s, c):
    """Go to the member of the family for the next longer delay; without one, or where none can help, hold wide.

    A loop swings at about its corner or faster; at less than half of that the piston sticks between two jumps. As
    designed the gains are those of the first member.
    """
    s[S_SWING_COUNT] = 0.0
    if s[S_COMMISSIONING] > 5.5 or s[S_SWING_PERIOD] * c[C_SECTOR_1] > 12.6:  # 4 pi
        widen_dead_band(s[S_SWING_AMPLITUDE], s, c)
        return
    enter(6.0, s)
    slower = slower_member(s, c)
    if slower < c[C_FAMILY_MEMBERS] + 0.5:
        set_member(slower, s, c)
        enter(5.0, s)


def count_half_swing(x, s):
    """Count a half swing that has ended at x (m), its period in s, and the length in m of the first of the count.

    One that is not within a factor of two of the first begins the count anew.
    """
    length = math.fabs(s[S_SWING_PEAK] - s[S_SWING_EDGE])
    if s[S_SWING_COUNT] > 0.5 and length > 0.5 * s[S_SWING_AMPLITUDE] and length < 2.0 * s[S_SWING_AMPLITUDE]:
        s[S_SWING_COUNT] += 1.0
    else:
        s[S_SWING_COUNT] = 1.0
        s[S_SWING_AMPLITUDE] = length
    s[S_SWING_PERIOD] = 2.0 * s[S_SWING_TIME]
    s[S_SWING_TIME] = 0.0
    s[S_SWING_EDGE] = s[S_SWING_PEAK]
    s[S_SWING_PEAK] = x
