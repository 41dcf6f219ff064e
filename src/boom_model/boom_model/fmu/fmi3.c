/* Functional Mock-up Interface 3.0, co-simulation. Follows machine.c. The types are the standard's own if its headers came first. */

#ifndef fmi3FunctionTypes_h
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3LockPreemptionCallback)();
typedef void (*fmi3UnlockPreemptionCallback)();
#endif

#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif
#ifdef FMI3_FUNCTION_PREFIX /* of several FMUs linked into one program */
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define NAME(function) JOINED(FMI3_FUNCTION_PREFIX, function)
#else
#define NAME(function) function
#endif
#define FUNCTION(function) PUBLIC fmi3Status NAME(function)
typedef const fmi3ValueReference *references_t;

typedef struct {
  machine_t *machine;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} instance_t;

static fmi3Status refused(instance_t *i, const char *message) {
  if (i && i->log) i->log(i->environment, fmi3Error, "logStatusError", message);
  return fmi3Error;
}

static fmi3Status checked(instance_t *i, int good) { return good ? fmi3OK : refused(i, i->machine->message); }

PUBLIC const char *NAME(fmi3GetVersion)(void) { return "3.0"; }

PUBLIC fmi3Instance NAME(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference required[], size_t n_required, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)early, (void)required, (void)update;
  instance_t here = {NULL, environment, log};
  if (!token || strcmp(token, TOKEN)) return refused(&here, "the model description is not that of this binary"), NULL;
  if (events || n_required) return refused(&here, "no event mode and no intermediate variables here"), NULL;
  instance_t *i = (instance_t *)malloc(sizeof(instance_t));
  here.machine = new_machine();
  if (!i || !here.machine) return free(i), free_machine(here.machine), NULL;
  *i = here;
  return i;
}

PUBLIC void NAME(fmi3FreeInstance)(fmi3Instance instance) {
  instance_t *i = (instance_t *)instance;
  if (i) free_machine(i->machine);
  free(i);
}

FUNCTION(fmi3SetDebugLogging)(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)instance, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

FUNCTION(fmi3EnterInitializationMode)(fmi3Instance instance, fmi3Boolean defined, fmi3Float64 tolerance, fmi3Float64 begin,
                                      fmi3Boolean stop_defined, fmi3Float64 stop) {
  machine_t *m = ((instance_t *)instance)->machine;
  (void)stop_defined, (void)stop;
  begin_at(m, begin, defined, tolerance);
  m->stage = INITIALISING;
  return fmi3OK;
}

FUNCTION(fmi3ExitInitializationMode)(fmi3Instance instance) {
  machine_t *m = ((instance_t *)instance)->machine;
  refresh(m);
  m->stage = STEPPING;
  return fmi3OK;
}

FUNCTION(fmi3Terminate)(fmi3Instance instance) {
  ((instance_t *)instance)->machine->stage = OVER;
  return fmi3OK;
}

FUNCTION(fmi3Reset)(fmi3Instance instance) {
  restore_defaults(((instance_t *)instance)->machine);
  return fmi3OK;
}

FUNCTION(fmi3DoStep)(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean no_return, fmi3Boolean *events,
                     fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
  instance_t *i = (instance_t *)instance;
  (void)no_return;
  *events = *terminate = *early = false;
  const int good = step_machine(i->machine, from, length);
  *reached = i->machine->present.time;
  return checked(i, good);
}

FUNCTION(fmi3GetFloat64)(fmi3Instance instance, references_t references, size_t n, fmi3Float64 values[], size_t n_values) {
  instance_t *i = (instance_t *)instance;
  if (n != n_values) return refused(i, "all variables are scalars: as many values as references");
  for (size_t k = 0; k < n; k++)
    if (!get_value(i->machine, references[k], values + k)) return checked(i, 0);
  return fmi3OK;
}

FUNCTION(fmi3SetFloat64)(fmi3Instance instance, references_t references, size_t n, const fmi3Float64 values[], size_t n_values) {
  instance_t *i = (instance_t *)instance;
  if (n != n_values) return refused(i, "all variables are scalars: as many values as references");
  for (size_t k = 0; k < n; k++)
    if (!set_value(i->machine, references[k], values[k])) return checked(i, 0);
  return fmi3OK;
}

FUNCTION(fmi3GetBoolean)(fmi3Instance instance, references_t references, size_t n, fmi3Boolean values[], size_t n_values) {
  instance_t *i = (instance_t *)instance;
  for (size_t k = 0; k < n && n == n_values; k++) {
    double value = 0.0;
    if (references[k] != ALL - 1) return refused(i, "this variable is no Boolean");
    get_value(i->machine, references[k], &value);
    values[k] = value != 0.0;
  }
  return n == n_values ? fmi3OK : fmi3Error;
}

FUNCTION(fmi3SetBoolean)(fmi3Instance instance, references_t references, size_t n, const fmi3Boolean values[], size_t n_values) {
  instance_t *i = (instance_t *)instance;
  for (size_t k = 0; k < n && n == n_values; k++) {
    if (references[k] != ALL - 1) return refused(i, "this variable is no Boolean");
    if (!set_value(i->machine, references[k], values[k] ? 1.0 : 0.0)) return checked(i, 0);
  }
  return n == n_values ? fmi3OK : fmi3Error;
}

FUNCTION(fmi3GetFMUState)(fmi3Instance instance, fmi3FMUState *state) {
  instance_t *i = (instance_t *)instance;
  if (!*state) *state = calloc(1, sizeof(machine_t));
  return *state && copy_machine((machine_t *)*state, i->machine) ? fmi3OK : refused(i, "no memory");
}

FUNCTION(fmi3SetFMUState)(fmi3Instance instance, fmi3FMUState state) {
  instance_t *i = (instance_t *)instance;
  return state && copy_machine(i->machine, (const machine_t *)state) ? fmi3OK : refused(i, "no such state");
}

FUNCTION(fmi3FreeFMUState)(fmi3Instance instance, fmi3FMUState *state) {
  (void)instance;
  if (state) {
    free_machine((machine_t *)*state);
    *state = NULL;
  }
  return fmi3OK;
}

/* What the capabilities of the model description leave out has to be there and say so. */
#define LEFT_OUT(function, ...) \
  FUNCTION(function)(fmi3Instance instance, __VA_ARGS__) { return refused((instance_t *)instance, #function " is not supported"); }
#define LEFT_OUT_ALONE(function) \
  FUNCTION(function)(fmi3Instance instance) { return refused((instance_t *)instance, #function " is not supported"); }
#define LEFT_OUT_TYPE(type) \
  LEFT_OUT(fmi3Get##type, references_t r, size_t n, fmi3##type v[], size_t nv) \
  LEFT_OUT(fmi3Set##type, references_t r, size_t n, const fmi3##type v[], size_t nv)
LEFT_OUT_TYPE(Float32) LEFT_OUT_TYPE(Int8) LEFT_OUT_TYPE(UInt8) LEFT_OUT_TYPE(Int16) LEFT_OUT_TYPE(UInt16) LEFT_OUT_TYPE(Int32)
LEFT_OUT_TYPE(UInt32) LEFT_OUT_TYPE(Int64) LEFT_OUT_TYPE(UInt64) LEFT_OUT_TYPE(String)
LEFT_OUT(fmi3GetBinary, references_t r, size_t n, size_t s[], fmi3Binary v[], size_t nv)
LEFT_OUT(fmi3SetBinary, references_t r, size_t n, const size_t s[], const fmi3Binary v[], size_t nv)
LEFT_OUT(fmi3GetClock, references_t r, size_t n, fmi3Clock v[])
LEFT_OUT(fmi3SetClock, references_t r, size_t n, const fmi3Clock v[])
LEFT_OUT(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
LEFT_OUT(fmi3GetVariableDependencies, fmi3ValueReference r, size_t a[], fmi3ValueReference b[], size_t c[], fmi3DependencyKind d[],
         size_t n)
LEFT_OUT(fmi3SerializedFMUStateSize, fmi3FMUState s, size_t *n)
LEFT_OUT(fmi3SerializeFMUState, fmi3FMUState s, fmi3Byte b[], size_t n)
LEFT_OUT(fmi3DeserializeFMUState, const fmi3Byte b[], size_t n, fmi3FMUState *s)
LEFT_OUT(fmi3GetDirectionalDerivative, references_t u, size_t nu, references_t k, size_t nk, const fmi3Float64 s[], size_t ns,
         fmi3Float64 d[], size_t nd)
LEFT_OUT(fmi3GetAdjointDerivative, references_t u, size_t nu, references_t k, size_t nk, const fmi3Float64 s[], size_t ns,
         fmi3Float64 d[], size_t nd)
LEFT_OUT(fmi3GetOutputDerivatives, references_t r, size_t n, const fmi3Int32 o[], fmi3Float64 v[], size_t nv)
LEFT_OUT(fmi3GetIntervalDecimal, references_t r, size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[])
LEFT_OUT(fmi3GetIntervalFraction, references_t r, size_t n, fmi3UInt64 c[], fmi3UInt64 s[], fmi3IntervalQualifier q[])
LEFT_OUT(fmi3GetShiftDecimal, references_t r, size_t n, fmi3Float64 v[])
LEFT_OUT(fmi3GetShiftFraction, references_t r, size_t n, fmi3UInt64 c[], fmi3UInt64 s[])
LEFT_OUT(fmi3SetIntervalDecimal, references_t r, size_t n, const fmi3Float64 v[])
LEFT_OUT(fmi3SetIntervalFraction, references_t r, size_t n, const fmi3UInt64 c[], const fmi3UInt64 s[])
LEFT_OUT(fmi3SetShiftDecimal, references_t r, size_t n, const fmi3Float64 v[])
LEFT_OUT(fmi3SetShiftFraction, references_t r, size_t n, const fmi3UInt64 c[], const fmi3UInt64 s[])
LEFT_OUT(fmi3UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *t)
LEFT_OUT(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
LEFT_OUT(fmi3SetTime, fmi3Float64 t)
LEFT_OUT(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
LEFT_OUT(fmi3GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
LEFT_OUT(fmi3GetEventIndicators, fmi3Float64 x[], size_t n)
LEFT_OUT(fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
LEFT_OUT(fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
LEFT_OUT(fmi3GetNumberOfEventIndicators, size_t *n)
LEFT_OUT(fmi3GetNumberOfContinuousStates, size_t *n)
LEFT_OUT(fmi3ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)
LEFT_OUT_ALONE(fmi3EnterEventMode)
LEFT_OUT_ALONE(fmi3EnterStepMode)
LEFT_OUT_ALONE(fmi3EnterConfigurationMode)
LEFT_OUT_ALONE(fmi3ExitConfigurationMode)
LEFT_OUT_ALONE(fmi3EnterContinuousTimeMode)
LEFT_OUT_ALONE(fmi3EvaluateDiscreteStates)

PUBLIC fmi3Instance NAME(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                       fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                       fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation");
  return NULL;
}

PUBLIC fmi3Instance NAME(fmi3InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                            fmi3Boolean visible, fmi3Boolean logging,
                                                            fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                            fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                            fmi3UnlockPreemptionCallback unlock) {
  (void)update, (void)lock, (void)unlock;
  return NAME(fmi3InstantiateModelExchange)(name, token, resources, visible, logging, environment, log);
}
