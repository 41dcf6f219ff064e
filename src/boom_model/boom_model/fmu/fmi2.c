/* Functional Mock-up Interface 2.0, co-simulation. Follows machine.c. The types are the standard's own if its headers came first. */

#include <stddef.h>
#ifndef fmi2FunctionTypes_h
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
  fmi2CallbackLogger logger;
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
  fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
#endif

#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif
#ifdef FMI2_FUNCTION_PREFIX /* of several FMUs linked into one program */
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define NAME(function) JOINED(FMI2_FUNCTION_PREFIX, function)
#else
#define NAME(function) function
#endif
#define FUNCTION(function) PUBLIC fmi2Status NAME(function)
typedef const fmi2ValueReference *references_t;

typedef struct {
  machine_t *machine;
  fmi2ComponentEnvironment environment;
  fmi2CallbackLogger log;
  char name[128];
} instance_t;

static fmi2Status refused(instance_t *i, const char *message) {
  if (i && i->log) i->log(i->environment, i->name, fmi2Error, "logStatusError", "%s", message);
  return fmi2Error;
}

static fmi2Status checked(instance_t *i, int good) { return good ? fmi2OK : refused(i, i->machine->message); }

PUBLIC const char *NAME(fmi2GetTypesPlatform)(void) { return "default"; }
PUBLIC const char *NAME(fmi2GetVersion)(void) { return "2.0"; }

PUBLIC fmi2Component NAME(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                                           const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  instance_t here = {NULL, functions ? functions->componentEnvironment : NULL, functions ? functions->logger : NULL, ""};
  (void)resources, (void)visible, (void)logging;
  snprintf(here.name, sizeof here.name, "%s", name ? name : "");
  if (type != fmi2CoSimulation) return refused(&here, "this FMU is for co-simulation"), NULL;
  if (!token || strcmp(token, TOKEN)) return refused(&here, "the model description is not that of this binary"), NULL;
  instance_t *i = (instance_t *)malloc(sizeof(instance_t));
  here.machine = new_machine();
  if (!i || !here.machine) return free(i), free_machine(here.machine), NULL;
  *i = here;
  return i;
}

PUBLIC void NAME(fmi2FreeInstance)(fmi2Component component) {
  instance_t *i = (instance_t *)component;
  if (i) free_machine(i->machine);
  free(i);
}

FUNCTION(fmi2SetDebugLogging)(fmi2Component component, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)component, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

FUNCTION(fmi2SetupExperiment)(fmi2Component component, fmi2Boolean defined, fmi2Real tolerance, fmi2Real begin,
                              fmi2Boolean stop_defined, fmi2Real stop) {
  (void)stop_defined, (void)stop;
  begin_at(((instance_t *)component)->machine, begin, defined, tolerance);
  return fmi2OK;
}

FUNCTION(fmi2EnterInitializationMode)(fmi2Component component) {
  ((instance_t *)component)->machine->stage = INITIALISING;
  return fmi2OK;
}

FUNCTION(fmi2ExitInitializationMode)(fmi2Component component) {
  machine_t *m = ((instance_t *)component)->machine;
  refresh(m);
  m->stage = STEPPING;
  return fmi2OK;
}

FUNCTION(fmi2Terminate)(fmi2Component component) {
  ((instance_t *)component)->machine->stage = OVER;
  return fmi2OK;
}

FUNCTION(fmi2Reset)(fmi2Component component) {
  restore_defaults(((instance_t *)component)->machine);
  return fmi2OK;
}

FUNCTION(fmi2DoStep)(fmi2Component component, fmi2Real from, fmi2Real length, fmi2Boolean no_return) {
  instance_t *i = (instance_t *)component;
  (void)no_return;
  return checked(i, step_machine(i->machine, from, length));
}

FUNCTION(fmi2GetReal)(fmi2Component component, references_t references, size_t n, fmi2Real values[]) {
  instance_t *i = (instance_t *)component;
  for (size_t k = 0; k < n; k++)
    if (!get_value(i->machine, references[k], values + k)) return checked(i, 0);
  return fmi2OK;
}

FUNCTION(fmi2SetReal)(fmi2Component component, references_t references, size_t n, const fmi2Real values[]) {
  instance_t *i = (instance_t *)component;
  for (size_t k = 0; k < n; k++)
    if (!set_value(i->machine, references[k], values[k])) return checked(i, 0);
  return fmi2OK;
}

FUNCTION(fmi2GetBoolean)(fmi2Component component, references_t references, size_t n, fmi2Boolean values[]) {
  instance_t *i = (instance_t *)component;
  for (size_t k = 0; k < n; k++) {
    double value = 0.0;
    if (references[k] != ALL - 1) return refused(i, "this variable is no Boolean");
    get_value(i->machine, references[k], &value);
    values[k] = value != 0.0;
  }
  return fmi2OK;
}

FUNCTION(fmi2SetBoolean)(fmi2Component component, references_t references, size_t n, const fmi2Boolean values[]) {
  instance_t *i = (instance_t *)component;
  for (size_t k = 0; k < n; k++) {
    if (references[k] != ALL - 1) return refused(i, "this variable is no Boolean");
    if (!set_value(i->machine, references[k], values[k] ? 1.0 : 0.0)) return checked(i, 0);
  }
  return fmi2OK;
}

FUNCTION(fmi2GetFMUstate)(fmi2Component component, fmi2FMUstate *state) {
  instance_t *i = (instance_t *)component;
  if (!*state) *state = calloc(1, sizeof(machine_t));
  return *state && copy_machine((machine_t *)*state, i->machine) ? fmi2OK : refused(i, "no memory");
}

FUNCTION(fmi2SetFMUstate)(fmi2Component component, fmi2FMUstate state) {
  instance_t *i = (instance_t *)component;
  return state && copy_machine(i->machine, (const machine_t *)state) ? fmi2OK : refused(i, "no such state");
}

FUNCTION(fmi2FreeFMUstate)(fmi2Component component, fmi2FMUstate *state) {
  (void)component;
  if (state) {
    free_machine((machine_t *)*state);
    *state = NULL;
  }
  return fmi2OK;
}

/* The time that was reached, after a step that failed; nothing is pending here. */
FUNCTION(fmi2GetRealStatus)(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value) {
  instance_t *i = (instance_t *)component;
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = i->machine->present.time;
  return fmi2OK;
}

FUNCTION(fmi2GetBooleanStatus)(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value) {
  (void)component;
  *value = 0;
  return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

/* What the capabilities of the model description leave out has to be there and say so. Nothing may be asked of a type without
   variables. */
#define LEFT_OUT(function, ...) \
  FUNCTION(function)(fmi2Component component, __VA_ARGS__) { \
    return refused((instance_t *)component, #function " is not supported"); \
  }
#define EMPTY(function, type) \
  FUNCTION(function)(fmi2Component component, references_t r, size_t n, type v[]) { \
    (void)r, (void)v; \
    return n ? refused((instance_t *)component, #function ": there are no such variables") : fmi2OK; \
  }
EMPTY(fmi2GetInteger, fmi2Integer)
EMPTY(fmi2SetInteger, const fmi2Integer)
EMPTY(fmi2GetString, fmi2String)
EMPTY(fmi2SetString, const fmi2String)
LEFT_OUT(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
LEFT_OUT(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
LEFT_OUT(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
LEFT_OUT(fmi2GetDirectionalDerivative, references_t u, size_t nu, references_t k, size_t nk, const fmi2Real s[], fmi2Real d[])
LEFT_OUT(fmi2SetRealInputDerivatives, references_t r, size_t n, const fmi2Integer o[], const fmi2Real v[])
LEFT_OUT(fmi2GetRealOutputDerivatives, references_t r, size_t n, const fmi2Integer o[], fmi2Real v[])
LEFT_OUT(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
LEFT_OUT(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
LEFT_OUT(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)

FUNCTION(fmi2CancelStep)(fmi2Component component) { return refused((instance_t *)component, "a step cannot be cancelled"); }
