/* Replay a file of test vectors (x_ref,x,p1,p2,u1,u2 a line, one header line) through the controller.
 *
 *     cc -std=c11 -O2 pneucli_replay.c pneucli_controller.c -lm -o replay && ./replay pneucli_replay.csv
 *
 * Prints the number of samples, the largest difference of a command in V, and the longest and mean time of a step in s.
 * Exit code 1 where a command differs by more than 1e-9 V.
 */
#include "pneucli_controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    static pneucli_controller controller;
    char line[512];
    long samples = 0;
    double worst = 0.0, longest = 0.0, total = 0.0;
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: %s pneucli_replay.csv\n", argv[0]);
        return 2;
    }
    pneucli_controller_init(&controller);
    while (fgets(line, sizeof line, file) != NULL) {
        double value[6], u[2], start, took;
        char *rest = line;
        int i;
        for (i = 0; i < 6; ++i) {
            value[i] = strtod(rest, &rest);
            rest += *rest == ',';
        }
        start = now();
        pneucli_controller_step(&controller, value[0], value[1], value[2], value[3], u);
        took = now() - start;
        total += took;
        longest = took > longest ? took : longest;
        for (i = 0; i < 2; ++i) {
            double off = fabs(u[i] - value[4 + i]);
            worst = off <= worst ? worst : off;
        }
        ++samples;
    }
    fclose(file);
    printf("%ld %.17g %.3g %.3g\n", samples, worst, longest, samples > 0 ? total / (double)samples : 0.0);
    return worst <= 1e-9 ? 0 : 1;
}
