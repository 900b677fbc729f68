/* Equations behind the functions of FMI 2.0 for model exchange. A model says how many variables, states and event indicators it has, and
   defines start values, rates, indicators and what an event does. Its states are its first variables.
   Written for these tests; the declarations of the standard's functions are our own, of what is used here. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

enum { OK = 0, DISCARD = 2, ERROR = 3 };

typedef struct {
    double value[VARIABLES], time;
    int mode; /* what its relations were at the last event */
    int told; /* of a complete step since it was last moved */
} Model;

/* fmi2EventInfo. */
typedef struct {
    int needed, terminate, nominals_changed, values_changed, has_next;
    double next;
} EventInfo;

static const double start_values[VARIABLES];
static int rates(Model *m, double *dx);        /* 0 where there are none */
static void outputs(Model *m);                 /* sets variables that are computed */
static void indicators(Model *m, double *z);
static int event(Model *m, EventInfo *info);   /* 1 if the states changed */
static int begin(Model *m);                    /* 0 where there is no such model; sets states at the start */

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    (void)name, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    Model *m = type == 0 ? calloc(1, sizeof *m) : NULL;
    for (int i = 0; m && i < VARIABLES; i++) m->value[i] = start_values[i];
    return m;
}
void fmi2FreeInstance(void *m) { free(m); }
int fmi2SetupExperiment(void *m, int tolerance_given, double tolerance, double start, int stop_given, double stop) {
    (void)tolerance_given, (void)tolerance, (void)stop_given, (void)stop;
    ((Model *)m)->time = start;
    return OK;
}
int fmi2EnterInitializationMode(void *m) { return (void)m, OK; }
int fmi2ExitInitializationMode(void *m) { return begin(m) ? OK : ERROR; }
int fmi2Reset(void *it) {
    Model *m = it;
    for (int i = 0; i < VARIABLES; i++) m->value[i] = start_values[i];
    m->mode = 0;
    return OK;
}
int fmi2SetReal(void *m, const unsigned *which, size_t n, const double *values) {
    for (size_t i = 0; i < n; i++) ((Model *)m)->value[which[i]] = values[i];
    return OK;
}
int fmi2GetReal(void *m, const unsigned *which, size_t n, double *values) {
    outputs(m);
#ifdef TOLD
    if (!((Model *)m)->told) return ERROR;
#endif
    for (size_t i = 0; i < n; i++) values[i] = ((Model *)m)->value[which[i]];
    return OK;
}
int fmi2EnterEventMode(void *m) { return (void)m, OK; }
int fmi2NewDiscreteStates(void *m, EventInfo *info) {
    info->needed = info->terminate = info->nominals_changed = info->has_next = 0;
    info->values_changed = event(m, info);
    return OK;
}
int fmi2EnterContinuousTimeMode(void *m) { return (void)m, OK; }
int fmi2SetTime(void *m, double time) { return ((Model *)m)->time = time, ((Model *)m)->told = 0, OK; }
int fmi2CompletedIntegratorStep(void *m, int prior, int *event, int *end) {
    ((Model *)m)->told = 1;
    return (void)prior, *event = *end = 0, OK;
}
int fmi2SetContinuousStates(void *m, const double *x, size_t n) {
    ((Model *)m)->told = 0;
    for (size_t i = 0; i < n; i++) ((Model *)m)->value[i] = x[i];
    return n == STATES ? OK : ERROR;
}
int fmi2GetContinuousStates(void *m, double *x, size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = ((Model *)m)->value[i];
    return n == STATES ? OK : ERROR;
}
int fmi2GetDerivatives(void *m, double *dx, size_t n) { return n != STATES ? ERROR : rates(m, dx) ? OK : DISCARD; }
int fmi2GetEventIndicators(void *m, double *z, size_t n) { return n != INDICATORS ? ERROR : (indicators(m, z), OK); }
