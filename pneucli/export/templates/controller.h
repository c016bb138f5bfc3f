/* Controller of the pipeline {pipeline}, written by pneucli {version}: {law}.
 * C99, no allocation, no library but math.h.
 *
 *     static pneucli_controller controller;
 *     double u[2];
 *     pneucli_controller_init(&controller);
 *     every PNEUCLI_CONTROLLER_PERIOD_S: pneucli_controller_step(&controller, x_ref, x, p1, p2, u);
 */
#ifndef PNEUCLI_CONTROLLER_H
#define PNEUCLI_CONTROLLER_H

#define PNEUCLI_CONTROLLER_PERIOD_S {period}
#define PNEUCLI_CONTROLLER_VALVES {valves}

#ifdef __cplusplus
extern "C" {{
#endif

typedef struct {{
    double state[{states}];
}} pneucli_controller;

/* Forget everything; the next step starts from its readings, at rest. */
void pneucli_controller_init(pneucli_controller *c);

/* One sample: reference and position in m, pressures absolute in Pa; commands in V. u[1] = 0 where there is one valve.
 * A reading that is not finite or out of range is bridged by what the controller expects. */
void pneucli_controller_step(pneucli_controller *c, double x_ref, double x, double p1, double p2, double u[2]);

#ifdef __cplusplus
}}
#endif

#endif
