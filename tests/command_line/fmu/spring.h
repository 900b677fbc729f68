/* A mass on a spring with a damper, pushed: m·x'' = F − k·x − c·x', by semi-implicit Euler steps of at most 1 ms.
   Written for these tests; the declarations of the standard's functions are our own, of what is used here. */
#include <math.h>
#include <stdlib.h>

enum { STIFFNESS, DAMPING, MASS, FORCE, PLACE, SPEED, VARIABLES };

typedef struct {
    double value[VARIABLES];
    int ready;
} Spring;

static void spring_reset(Spring *s) {
    double start[VARIABLES] = {4.0, 0.5, 1.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < VARIABLES; i++) s->value[i] = start[i];
    s->ready = 0;
}

/* 0 where there is no such spring. */
static int spring_begin(Spring *s) { return s->ready = s->value[MASS] > 0.0; }

/* 0 where the mass is lost. */
static int spring_step(Spring *s, double step) {
    double *v = s->value;
    int steps = (int)ceil(step / 1e-3 - 1e-9);
    double dt = step / steps;
    for (int i = 0; i < steps; i++) {
        v[SPEED] += dt * (v[FORCE] - v[STIFFNESS] * v[PLACE] - v[DAMPING] * v[SPEED]) / v[MASS];
        v[PLACE] += dt * v[SPEED];
    }
    return fabs(v[PLACE]) < 1e3;
}
