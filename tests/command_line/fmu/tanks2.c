/* Two tanks, one above the other: h1' = -k1*sqrt(h1) + k4*u, h2' = k2*sqrt(h1) - k3*sqrt(h2), y = h2. */
enum { H1, H2, K1, K2, K3, K4, U, Y, VARIABLES };
enum { STATES = 2, INDICATORS = 0 };
#include "exchange2.h"

static const double start_values[VARIABLES] = {0.0, 0.0, 0.6, 0.6, 0.6, 1.0, 0.0, 0.0};

static double outflow(double level) { return sqrt(fmax(fabs(level), 1e-6)); }

static int rates(Model *m, double *dx) {
    double *v = m->value;
    dx[H1] = -v[K1] * outflow(v[H1]) + v[K4] * v[U];
    dx[H2] = v[K2] * outflow(v[H1]) - v[K3] * outflow(v[H2]);
#ifdef FRAGILE
    return v[K1] < 1.4;
#endif
    return 1;
}
static void outputs(Model *m) { m->value[Y] = m->value[H2]; }
static void indicators(Model *m, double *z) { (void)m, (void)z; }
static int event(Model *m, EventInfo *info) { return (void)m, (void)info, 0; }
#ifdef FRAGILE
static int begin(Model *m) { return m->value[K4] < 1.4; }
#else
static int begin(Model *m) { return (void)m, 1; }
#endif
