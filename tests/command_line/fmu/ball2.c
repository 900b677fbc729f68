/* A ball that falls onto a floor, and is thrown up at 2 s: h' = v, v' = -g; where h becomes negative, v turns to -e*v. As tools write it, the
   ball bounces when the relation h < 0 becomes true, which it remembers. */
enum { H, V, E, KICK, Y, VARIABLES };
enum { STATES = 2, INDICATORS = 1 };
#include "exchange2.h"

static const double start_values[VARIABLES] = {1.0, 0.0, 0.8, 0.0, 0.0};
static const double kicked = 2.0;

enum { BELOW = 1, KICKED = 2 };

static int rates(Model *m, double *dx) {
    dx[H] = m->value[V];
    dx[V] = -9.81;
    return 1;
}
static void outputs(Model *m) { m->value[Y] = m->value[H]; }
static void indicators(Model *m, double *z) { z[0] = m->value[H]; }
static int event(Model *m, EventInfo *info) {
    double before = m->value[V];
    int below = m->value[H] < 0.0;
    if (below && !(m->mode & BELOW)) m->value[V] = -m->value[E] * m->value[V];
    m->mode = below ? m->mode | BELOW : m->mode & ~BELOW;
    if (m->time >= kicked && !(m->mode & KICKED)) {
        m->value[V] += m->value[KICK];
        m->mode |= KICKED;
    }
    info->has_next = !(m->mode & KICKED);
    info->next = kicked;
    return m->value[V] != before;
}
static int begin(Model *m) { return (void)m, 1; }
