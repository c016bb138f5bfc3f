/* Replay a file of test vectors through the controller: x_ref,x,p1,p2,u1,u2,supply,duty,level a line, one header line;
 * the last three may be left out. duty: 0 run, 1 hold, 2 not enabled, 3 reset from these readings and the last commands,
 * 5 begin a commissioning.
 *
 *     cc -std=c11 -O2 pneucli_replay.c pneucli_controller.c -lm -o replay && ./replay pneucli_replay.csv
 *
 * Prints the number of samples, the largest difference of a command in V, and the longest and mean time of a step in s.
 * Exit code 1 where a command differs by more than the limit, 1e-9 V unless a second argument says otherwise.
 */
#include "pneucli_controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
#ifdef TIME_UTC /* C11 */
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#else /* C99: processor time */
    return (double)clock() / (double)CLOCKS_PER_SEC;
#endif
}

static void operate(pneucli_controller *c, const double value[9], const @REAL@ u[2])
{
    int duty = (int)value[7];
    if (value[6] > 0.0) {
        pneucli_controller_set_supply(c, (@REAL@)value[6]);
    }
    pneucli_controller_set_level(c, (@REAL@)value[8]);
    pneucli_controller_enable(c, duty != 2);
    pneucli_controller_hold(c, duty == 1);
    if (duty == 3) {
        pneucli_controller_reset(c, (@REAL@)value[1], (@REAL@)value[2], (@REAL@)value[3], u);
    }
    if (duty == 5) {
        pneucli_controller_commission(c, 0, 0);
    }
}

int main(int argc, char **argv)
{
    static pneucli_controller controller;
    char line[512];
    long samples = 0;
    double worst = 0.0, longest = 0.0, total = 0.0, limit = argc > 2 ? strtod(argv[2], NULL) : 1e-9;
    @REAL@ u[2] = {0, 0};
    FILE *file = argc >= 2 ? fopen(argv[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: %s pneucli_replay.csv [limit in V]\n", argv[0]);
        return 2;
    }
    pneucli_controller_init(&controller);
    while (fgets(line, sizeof line, file) != NULL) {
        double value[9] = {0.0}, start, took;
        char *rest = line;
        int i;
        for (i = 0; i < 9; ++i) {
            value[i] = strtod(rest, &rest);
            rest += *rest == ',';
        }
        operate(&controller, value, u);
        start = now();
        pneucli_controller_step(
            &controller, (@REAL@)value[0], (@REAL@)value[1], (@REAL@)value[2], (@REAL@)value[3], u);
        took = now() - start;
        total += took;
        longest = took > longest ? took : longest;
        for (i = 0; i < 2; ++i) {
            double off = fabs((double)u[i] - value[4 + i]);
            worst = off <= worst ? worst : off;
        }
        ++samples;
    }
    fclose(file);
    printf("%ld %.17g %.3g %.3g\n", samples, worst, longest, samples > 0 ? total / (double)samples : 0.0);
    return worst <= limit ? 0 : 1;
}
