/* Controller of the pipeline @PIPELINE@, written by pneucli @VERSION@: see pneucli_controller.h. */
#include "pneucli_controller.h"

#include <math.h>

enum { @STATE@ };

enum { @PARAMETERS@ };
@OWN@
static const double PARAMETERS[] = {
@NUMBERS@
};

static double smaller(double a, double b)
{
    return b < a ? b : a;
}

static double larger(double a, double b)
{
    return b > a ? b : a;
}

@FUNCTIONS@

void pneucli_controller_init(pneucli_controller *c)
{
    int i;
    for (i = 0; i < (int)(sizeof c->state / sizeof c->state[0]); ++i) {
        c->state[i] = 0.0;
    }
}

void pneucli_controller_step(pneucli_controller *c, double x_ref, double x, double p1, double p2, double u[2])
{
    @STEP@(x_ref, x, p1, p2, c->state, PARAMETERS);
    u[0] = c->state[S_U1];
    u[1] = c->state[S_U2];
}
