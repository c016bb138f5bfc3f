/* Controller of the pipeline @PIPELINE@, written by pneucli @VERSION@: @LAW@.
 * C99, no allocation, no library but math.h.
 *
 *     static pneucli_controller controller;
 *     @REAL@ u[2];
 *     pneucli_controller_init(&controller);
 *     every PNEUCLI_CONTROLLER_PERIOD_S: pneucli_controller_step(&controller, x_ref, x, p1, p2, u);
 */
#ifndef PNEUCLI_CONTROLLER_H
#define PNEUCLI_CONTROLLER_H

#define PNEUCLI_CONTROLLER_PERIOD_S @PERIOD@
#define PNEUCLI_CONTROLLER_VALVES @VALVES@
#define PNEUCLI_CONTROLLER_HASH "@HASH@"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    @REAL@ state[@STATES@];
    @REAL@ numbers[@COUNT@]; /* as designed, until a commissioning changes them */
} pneucli_controller;

/* What a commissioning found. state: 0 as designed; 1 valves shut, 2 and 3 relay tests of valve 1 and 2; 4 commissioned;
 * 5 slower after a limit cycle, 6 a limit cycle that persists; valves shut after 10 a stop, 11 the limit of travel,
 * 12 that of pressure, 13 a pressure that does not reverse, 14 a missing reading, 15 a reading that is
 * too noisy, 16 a pressure that went against the command, 17 one whose rate is not half to twice the model's. */
typedef struct {
    int state;
    @REAL@ null_1, null_2;      /* V, added to the null commands of the design */
    @REAL@ delay, overshoot;    /* s: delay of the pressure; its share that overshoots: all of a delay, 0.3 of a lag */
    @REAL@ gain;                /* rate of the pressure over that of the model */
    int member;                 /* of the family of gains; 0: as designed */
    @REAL@ swing, swing_period; /* m, s: the last swing at rest beyond twice the tolerance */
} pneucli_controller_status;

/* Forget everything; the next step starts from its readings, at rest. Enabled, not held, supply as designed.
 * Call it once before all others. */
void pneucli_controller_init(pneucli_controller *c);

/* One sample: reference and position in m, pressures absolute in Pa; commands in V. u[1] = 0 where there is one valve.
 * A reading that is not finite or out of range is bridged by what the controller expects. */
void pneucli_controller_step(pneucli_controller *c, @REAL@ x_ref, @REAL@ x, @REAL@ p1, @REAL@ p2, @REAL@ u[2]);

/* The measured supply pressure, absolute in Pa, before a step where there is a new one. Without it, that of the design. */
void pneucli_controller_set_supply(pneucli_controller *c, @REAL@ p);

/* The mean of both pressures that shall be kept, absolute in Pa, where two valves drive the chambers: more is stiffer.
 * 0: as designed. It moves there no faster than the valves can follow. With one valve it does nothing. */
void pneucli_controller_set_level(pneucli_controller *c, @REAL@ p);

/* off (0): steps shut the valves and control nothing. on: the next step starts from its readings, without a bump. */
void pneucli_controller_enable(pneucli_controller *c, int on);

/* on: stop as fast as the reference may and stay there, whatever x_ref is. off (0): go on to x_ref. */
void pneucli_controller_hold(pneucli_controller *c, int on);

/* Start from an axis that rests under the commands u, those of a hand or of another controller: the next step's commands
 * are u, and what is then changed fades in. */
void pneucli_controller_reset(pneucli_controller *c, @REAL@ x, @REAL@ p1, @REAL@ p2, const @REAL@ u[2]);

/* Find null, delay and gain of the valves with the axis at rest, within limits of travel in m and pressure in Pa from
 * there (0: as designed), then set the gains. It takes about 2 s, in which x_ref is ignored; disabling stops it. */
void pneucli_controller_commission(pneucli_controller *c, @REAL@ travel, @REAL@ pressure);

pneucli_controller_status pneucli_controller_commissioned(const pneucli_controller *c);

#ifdef __cplusplus
}
#endif

#endif
