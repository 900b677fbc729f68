/* The spring behind the functions of FMI 2.0 for co-simulation. */
#include "spring.h"
#include <stddef.h>

enum { OK = 0, DISCARD = 2, ERROR = 3 };

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                      int visible, int logging) {
    (void)name, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    Spring *s = type == 1 ? malloc(sizeof *s) : NULL;
    if (s) spring_reset(s);
    return s;
}
void fmi2FreeInstance(void *s) { free(s); }
int fmi2SetupExperiment(void *s, int tolerance_given, double tolerance, double start, int stop_given, double stop) {
    (void)s, (void)tolerance_given, (void)tolerance, (void)start, (void)stop_given, (void)stop;
    return OK;
}
int fmi2EnterInitializationMode(void *s) { return ((Spring *)s)->ready ? ERROR : OK; }
int fmi2ExitInitializationMode(void *s) { return spring_begin(s) ? OK : ERROR; }
int fmi2Reset(void *s) {
#ifdef NO_RESET
    (void)s;
    return ERROR;
#else
    spring_reset(s);
    return OK;
#endif
}
int fmi2SetReal(void *s, const unsigned *which, size_t n, const double *values) {
    for (size_t i = 0; i < n; i++) ((Spring *)s)->value[which[i]] = values[i];
    return OK;
}
int fmi2GetReal(void *s, const unsigned *which, size_t n, double *values) {
    for (size_t i = 0; i < n; i++) values[i] = ((Spring *)s)->value[which[i]];
    return OK;
}
int fmi2DoStep(void *s, double now, double step, int no_way_back) {
    (void)now, (void)no_way_back;
    return spring_step(s, step) ? OK : DISCARD;
}
