/* The spring behind the functions of FMI 3.0 for co-simulation. */
#include "spring.h"
#include <stdbool.h>
#include <stddef.h>

enum { OK = 0, ERROR = 3 };

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const unsigned *between, size_t n, void *environment,
                                  void (*log)(void), void (*update)(void)) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)between, (void)n, (void)environment, (void)log, (void)update;
    Spring *s = malloc(sizeof *s);
    if (s) spring_reset(s);
    return s;
}
void fmi3FreeInstance(void *s) { free(s); }
int fmi3EnterInitializationMode(void *s, bool tolerance_given, double tolerance, double start, bool stop_given, double stop) {
    (void)s, (void)tolerance_given, (void)tolerance, (void)start, (void)stop_given, (void)stop;
    return OK;
}
int fmi3ExitInitializationMode(void *s) { return spring_begin(s) ? OK : ERROR; }
int fmi3Reset(void *s) {
    spring_reset(s);
    return OK;
}
int fmi3SetFloat64(void *s, const unsigned *which, size_t n, const double *values, size_t many) {
    for (size_t i = 0; i < n && n == many; i++) ((Spring *)s)->value[which[i]] = values[i];
    return n == many ? OK : ERROR;
}
int fmi3GetFloat64(void *s, const unsigned *which, size_t n, double *values, size_t many) {
    for (size_t i = 0; i < n && n == many; i++) values[i] = ((Spring *)s)->value[which[i]];
    return n == many ? OK : ERROR;
}
/* A mass that is lost ends the simulation, which is no error in this version. */
int fmi3DoStep(void *s, double now, double step, bool no_way_back, bool *event, bool *end, bool *early, double *reached) {
    (void)no_way_back;
    *event = *early = false;
    *end = !spring_step(s, step);
    *reached = now + step;
    return OK;
}
