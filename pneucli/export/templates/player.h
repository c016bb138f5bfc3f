/* Player of the planned commands of the pipeline @PIPELINE@, written by pneucli @VERSION@.
 * C99, no allocation, no library but math.h.
 *
 *     static pneucli_player player;
 *     double out[4];
 *     pneucli_player_init(&player);
 *     every PNEUCLI_PLAYER_PERIOD_S: pneucli_player_step(&player, enable, x, p1, p2, out);
 *
 * Recordings: @NAMES@
 */
#ifndef PNEUCLI_PLAYER_H
#define PNEUCLI_PLAYER_H

#define PNEUCLI_PLAYER_PERIOD_S @PERIOD@

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    double soft;    /* s since the soft start began */
    double time;    /* s within the segment */
    double first_x; /* m, the position where it began */
    int segment;
    int state;      /* 0: waits for enable, 1: soft start, 2: plays, 3: done, 4: stopped by a limit or by enable = 0 */
} pneucli_player;

/* Forget everything; the next step with enable starts from its readings. */
void pneucli_player_init(pneucli_player *c);

/* One sample: position in m, pressures absolute in Pa; 0 for a sensor that the bench lacks. out[0]: command in V,
 * out[1]: command of the second valve in V, out[2]: position reference in m, out[3]: number of the recording, 0 between
 * two. With enable = 0, after the last recording, and once a reading leaves its limits, the commands are the null
 * command; only init starts again. */
void pneucli_player_step(pneucli_player *c, int enable, double x, double p1, double p2, double out[4]);

#ifdef __cplusplus
}
#endif

#endif
