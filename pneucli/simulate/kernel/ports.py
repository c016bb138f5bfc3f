"""The ports without any effect; :mod:`pneucli.simulate.build` puts the effects' equations in their place."""


def demand(u, p, p_amb, th, on):
    return u


def command(u, h, s, th, on):
    return u


def switched(position, h, s, th, on):
    return position


def has_switched(on):
    return False


def critical_ratio(b, th, on):
    return b


def filling(q, full, p, p_amb, th, on):
    return q


def has_filling(on):
    return False


def leak_area(th, on):
    return 0.0


def leak_1_ambient(p1, p_amb, k, th, on):
    return 0.0


def leak_2_ambient(p2, p_amb, k, th, on):
    return 0.0


def leak_1_2(p1, p2, k, th, on):
    return 0.0


def volume_1(th, on):
    return 0.0


def volume_2(th, on):
    return 0.0


def heat(T, T_wall, th, on):
    return 0.0


def has_heat(on):
    return False


def supply(p, p_set, q, k_gas, h, s, th, on):
    return p


def flow_delay(th, on):
    return 0.0


def flow_delay_1(th, on):
    return 0.0


def flow_delay_2(th, on):
    return 0.0


def hose_bore(th, on):
    return 0.0


def hose_bore_1(th, on):
    return 0.0


def hose_bore_2(th, on):
    return 0.0


def dry_rise(coulomb, v, th, on):
    return 0.0


def slowing(th, on):
    return 1.0


def slowing_viscous(th, on):
    return 1.0


def has_slowing(on):
    return False


def dry_factor(direction, x, p1, p2, p_amb, th, on):
    return 1.0


def static_factor(rest_time, th, on):
    return 1.0


def viscous_factor(direction, th, on):
    return 1.0


def force(x, v, stroke, th, on):
    return 0.0


def mass(th, on):
    return 0.0


def bristle_stiffness(th, on):
    return 0.0


def bristle_damping(th, on):
    return 0.0


def read_p1(p, p_amb, th, on):
    return p


def read_p2(p, p_amb, th, on):
    return p


def unread_p1(p, p_amb, th, on):
    return p


def unread_p2(p, p_amb, th, on):
    return p


def read_a(a, th, on):
    return a


def sensor_lag(th, on):
    return 0.0


def sensor_delay(th, on):
    return 0.0


def force_delay(th, on):
    return 0.0


def scalars(base, th, on):
    return base, th, on
