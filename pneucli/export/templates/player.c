/* Player of the planned commands of the pipeline @PIPELINE@, written by pneucli @VERSION@: see pneucli_player.h. */
#include "pneucli_player.h"

#include <math.h>

enum { SEGMENTS = @SEGMENTS@, NUMBERS = 9 };
enum { DURATION, START, END, AMPLITUDE, FREQUENCY, RISE, GAIN, KIND, RECORDING };
enum { WAITS, SOFT_START, PLAYS, DONE, STOPPED };

static const double PI = 3.141592653589793;
static const double NULL_COMMAND = @NULL@;
static const double MAX_COMMAND = @COMMAND@;
static const double LOWEST_X = @LOW@;
static const double HIGHEST_X = @HIGH@;
static const double MAX_PRESSURE = @PRESSURE@;
static const double SOFT_START_TIME = @SOFT_START@;
static const double MAX_SPEED = @SPEED@; /* m/s, of the reference in a soft start */
static const int MIRRORED = @MIRRORED@;

static const double SEGMENT[SEGMENTS * NUMBERS] = {
@TABLE@
};

static double within(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

static double value_at(const double *s, double time)
{
    double value = s[START] + (s[END] - s[START]) * time / s[DURATION];
    if (s[AMPLITUDE] != 0.0) {
        double envelope = within(fmin(time, s[DURATION] - time) / s[RISE], 0.0, 1.0);
        value += s[AMPLITUDE] * envelope * sin(2.0 * PI * s[FREQUENCY] * time);
    }
    return value;
}

static double soft_start_time(const double *s, double first_x)
{
    return s[KIND] > 0.5 ? fmax(SOFT_START_TIME, fabs(s[START] - first_x) / MAX_SPEED) : SOFT_START_TIME;
}

static int keeps_limits(double x, double p1, double p2)
{
    /* comparisons with a reading that is no number are false */
    return x >= LOWEST_X && x <= HIGHEST_X && p1 <= MAX_PRESSURE && p2 <= MAX_PRESSURE;
}

void pneucli_player_init(pneucli_player *c)
{
    c->soft = c->time = c->first_x = 0.0;
    c->segment = 0;
    c->state = WAITS;
}

void pneucli_player_step(pneucli_player *c, int enable, double x, double p1, double p2, double out[4])
{
    const double *s;
    double value;
    out[0] = out[1] = NULL_COMMAND;
    out[2] = x;
    out[3] = 0.0;
    if (c->state == WAITS && enable) {
        c->state = SOFT_START;
        c->first_x = x;
    }
    if (c->state == WAITS || c->state == DONE || c->state == STOPPED) {
        return;
    }
    if (!enable || !keeps_limits(x, p1, p2)) {
        c->state = STOPPED;
        return;
    }
    s = SEGMENT + NUMBERS * c->segment;
    if (c->state == SOFT_START) {
        double share = within(c->soft / soft_start_time(s, c->first_x), 0.0, 1.0);
        double from = s[KIND] > 0.5 ? c->first_x : NULL_COMMAND;
        value = from + (s[START] - from) * share;
        c->soft += PNEUCLI_PLAYER_PERIOD_S;
        if (share >= 1.0) {
            c->state = PLAYS;
        }
    } else {
        value = value_at(s, c->time);
        out[3] = s[RECORDING];
        c->time += PNEUCLI_PLAYER_PERIOD_S;
        if (c->time >= s[DURATION] - 0.5 * PNEUCLI_PLAYER_PERIOD_S) {
            c->time = 0.0;
            c->segment += 1;
            if (c->segment >= SEGMENTS) {
                c->state = DONE;
                c->segment = SEGMENTS - 1;
            } else if (s[NUMBERS + KIND] > 0.5 && s[KIND] < 0.5) {
                /* the valve moved the piston: the loop takes it from where it is */
                c->state = SOFT_START;
                c->soft = 0.0;
                c->first_x = x;
            }
        }
    }
    if (s[KIND] > 0.5) {
        out[2] = value;
        value = NULL_COMMAND + s[GAIN] * (value - x);
    }
    out[0] = within(value, NULL_COMMAND - MAX_COMMAND, NULL_COMMAND + MAX_COMMAND);
    out[1] = MIRRORED ? 2.0 * NULL_COMMAND - out[0] : NULL_COMMAND;
}
