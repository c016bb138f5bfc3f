/* Controller of the pipeline @PIPELINE@, written by pneucli @VERSION@: see pneucli_controller.h. */
#include "pneucli_controller.h"

#include <math.h>

enum { @STATE@ };

enum { L_STATES = @STATES@ };

enum { @PARAMETERS@ };
@OWN@
static const @REAL@ PARAMETERS[] = {
@NUMBERS@
};

static @REAL@ smaller(@REAL@ a, @REAL@ b)
{
    return b < a ? b : a;
}

static @REAL@ larger(@REAL@ a, @REAL@ b)
{
    return b > a ? b : a;
}

@FUNCTIONS@

void pneucli_controller_init(pneucli_controller *c)
{
    int i;
    for (i = 0; i < L_STATES; ++i) {
        c->state[i] = 0;
    }
    for (i = 0; i < (int)(sizeof PARAMETERS / sizeof PARAMETERS[0]); ++i) {
        c->numbers[i] = PARAMETERS[i];
    }
}

void pneucli_controller_set_supply(pneucli_controller *c, @REAL@ p)
{
    set_supply(p, c->state, c->numbers);
}

void pneucli_controller_set_level(pneucli_controller *c, @REAL@ p)
{
    set_level(p, c->state, c->numbers);
}

void pneucli_controller_enable(pneucli_controller *c, int on)
{
    enable(on ? 1 : 0, c->state);
}

void pneucli_controller_hold(pneucli_controller *c, int on)
{
    pause(on ? 1 : 0, c->state);
}

void pneucli_controller_reset(pneucli_controller *c, @REAL@ x, @REAL@ p1, @REAL@ p2, const @REAL@ u[2])
{
    reset(x, p1, p2, u[0], u[1], c->state, c->numbers);
}

void pneucli_controller_commission(pneucli_controller *c, @REAL@ travel, @REAL@ pressure)
{
    commission(travel, pressure, c->state, c->numbers);
}

pneucli_controller_status pneucli_controller_commissioned(const pneucli_controller *c)
{
    const @REAL@ *s = c->state;
    pneucli_controller_status found;
    found.state = (int)s[S_COMMISSIONING];
    found.null_1 = s[S_NULL_FOUND1];
    found.null_2 = s[S_NULL_FOUND2];
    found.delay = s[S_DELAY_FOUND];
    found.overshoot = s[S_OVERSHOOT_FOUND];
    found.gain = s[S_GAIN_FOUND];
    found.member = (int)s[S_MEMBER];
    found.swing = s[S_SWING_AMPLITUDE];
    found.swing_period = s[S_SWING_PERIOD];
    return found;
}

void pneucli_controller_step(pneucli_controller *c, @REAL@ x_ref, @REAL@ x, @REAL@ p1, @REAL@ p2, @REAL@ u[2])
{
    @REAL@ *s = c->state, *n = c->numbers;
    if (s[S_DISABLED] > 0) {
        close_valves(s, n);
    } else if (!run_commissioning(x, p1, p2, s, n)) {
        @STEP@(active_reference(x_ref, x, p1, p2, s, n), x, p1, p2, s, n);
        finish_commands(s, n);
        watch_limit_cycle(x, s, n);
    }
    u[0] = s[S_U1];
    u[1] = s[S_U2];
}
