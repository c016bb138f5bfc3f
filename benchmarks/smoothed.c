/* The smoothed equations that pneucli's kernel is measured against: two chambers (thesis 2.47-2.52), a valve by its
   table of areas with the flow function 2.42, Coulomb and viscous friction with tanh for the sign, RK4.
   A proportional controller with a limit is called at each sample of the reference; its command is held. */
#include <math.h>

enum { COULOMB, VISCOUS, MASS, AREA_1, AREA_2, STROKE, DEAD_1, DEAD_2, AMBIENT, SUPPLY, TEMP, GAMMA, GAS, CRITICAL };
enum { X, V, P1, P2, STATES };

typedef struct {
    const double *base, *areas;
    double u_max, smoothing, k;
    int points;
} model;

static double flow_function(double r, double b)
{
    if (r <= b) return 0.484;
    if (r >= 1.0) return 0.0;
    double s = (r - b) / (1.0 - b);
    return 0.484 * sqrt(1.0 - s * s);
}

static double orifice_flow(const model *m, double from, double to)
{
    if (from >= to) return from * m->k * flow_function(to / from, m->base[CRITICAL]);
    return -to * m->k * flow_function(from / to, m->base[CRITICAL]);
}

static double area_of(const model *m, double u)
{
    int last = m->points - 1;
    double place = (u + m->u_max) * (last / (2.0 * m->u_max));
    if (place <= 0.0) return m->areas[0];
    if (place >= last) return m->areas[last];
    int i = (int)place;
    return m->areas[i] + (place - i) * (m->areas[i + 1] - m->areas[i]);
}

static void rates(const model *m, const double *s, double u, double area, double *ds)
{
    const double *b = m->base;
    double q = u > 0.0 ? area * orifice_flow(m, b[SUPPLY], s[P1]) : -area * orifice_flow(m, s[P1], b[AMBIENT]);
    double push = b[AREA_1] * (s[P1] - b[AMBIENT]) - b[AREA_2] * (s[P2] - b[AMBIENT]);
    double friction = b[COULOMB] * tanh(s[V] / m->smoothing) + b[VISCOUS] * s[V];
    ds[X] = s[V];
    ds[V] = (push - friction) / b[MASS];
    ds[P1] = b[GAMMA] * (b[GAS] * b[TEMP] * q - s[P1] * b[AREA_1] * s[V]) / (b[DEAD_1] + b[AREA_1] * s[X]);
    ds[P2] = b[GAMMA] * s[P2] * b[AREA_2] * s[V] / (b[DEAD_2] + b[AREA_2] * (b[STROKE] - s[X]));
}

static void rk4(const model *m, double *s, double u, double area, double h)
{
    static const double node[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    double sum[STATES] = {0}, slope[STATES] = {0}, at[STATES];
    for (int stage = 0; stage < 4; stage++) {
        for (int i = 0; i < STATES; i++) at[i] = s[i] + h * node[stage] * slope[i];
        rates(m, at, u, area, slope);
        for (int i = 0; i < STATES; i++) sum[i] += weight[stage] * slope[i];
    }
    for (int i = 0; i < STATES; i++) s[i] += h * sum[i];
}

/* reference (n,) at every period s; state (4,) at the start; base as in pneucli.simulate.layout; out (n, 4). */
void run(int n, double period, int substeps, const double *reference, const double *state, const double *base,
         const double *areas, int points, double u_max, double smoothing, double gain, double limit, double *out)
{
    model m = {base, areas, u_max, smoothing, sqrt(2.0 / (base[GAS] * base[TEMP])), points};
    double s[STATES] = {state[X], state[V], state[P1], state[P2]};
    for (int k = 0; k < n; k++) {
        for (int i = 0; i < STATES; i++) out[STATES * k + i] = s[i];
        double u = fmin(fmax(gain * (reference[k] - s[X]), -limit), limit);
        double area = area_of(&m, u);
        for (int i = 0; i < substeps; i++) {
            rk4(&m, s, u, area, period / substeps);
            if (s[X] < 0.0 || s[X] > base[STROKE]) {
                s[X] = fmin(fmax(s[X], 0.0), base[STROKE]);
                s[V] = 0.0;
            }
        }
    }
}
