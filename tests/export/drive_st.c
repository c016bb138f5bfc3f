/* Drives what iec2c makes of the structured text through a replay file; prints samples and the largest difference. */
#include "POUS.h"
#include "POUS.c"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

TIME __CURRENT_TIME;
BOOL __DEBUG;

int main(int argc, char **argv)
{
    static PNEUCLI_CONTROLLER c;
    char line[512];
    double worst = 0.0;
    long samples = 0;
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        return 2;
    }
    PNEUCLI_CONTROLLER_init__(&c, 0);
    while (fgets(line, sizeof line, file) != NULL) {
        double value[9] = {0.0};
        char *rest = line;
        int i;
        for (i = 0; i < 9; ++i) {
            value[i] = strtod(rest, &rest);
            rest += *rest == ',';
        }
        c.X_REF.value = value[0], c.X.value = value[1], c.P1.value = value[2], c.P2.value = value[3];
        c.SUPPLY.value = value[6], c.LEVEL.value = value[8];
        c.ENABLE.value = value[7] != 2.0, c.HOLD.value = value[7] == 1.0, c.TAKE_OVER.value = value[7] == 3.0;
        c.COMMISSION.value = value[7] == 5.0;
        c.U1_NOW.value = c.U1.value, c.U2_NOW.value = c.U2.value;
        PNEUCLI_CONTROLLER_body__(&c);
        for (i = 0; i < 2; ++i) {
            double off = fabs((i == 0 ? c.U1.value : c.U2.value) - value[4 + i]);
            worst = off <= worst ? worst : off;
        }
        ++samples;
    }
    fclose(file);
    printf("%ld %.17g\n", samples, worst);
    return 0;
}
