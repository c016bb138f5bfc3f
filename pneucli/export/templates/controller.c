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
}

void pneucli_controller_set_supply(pneucli_controller *c, @REAL@ p)
{
    set_supply(p, c->state, PARAMETERS);
}

void pneucli_controller_set_level(pneucli_controller *c, @REAL@ p)
{
    set_level(p, c->state, PARAMETERS);
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
    reset(x, p1, p2, u[0], u[1], c->state, PARAMETERS);
}

void pneucli_controller_step(pneucli_controller *c, @REAL@ x_ref, @REAL@ x, @REAL@ p1, @REAL@ p2, @REAL@ u[2])
{
    @REAL@ *s = c->state;
    if (s[S_DISABLED] > 0) {
        close_valves(s, PARAMETERS);
    } else {
        @STEP@(active_reference(x_ref, x, p1, p2, s, PARAMETERS), x, p1, p2, s, PARAMETERS);
        finish_commands(s, PARAMETERS);
    }
    u[0] = s[S_U1];
    u[1] = s[S_U2];
}
