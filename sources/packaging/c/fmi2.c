/* FMI 2.0, co-simulation and model exchange; declarations follow the standard, section 2 to 4. */

typedef int fmi2Status;
typedef int fmi2Boolean;
typedef struct {
  void (*logger)(void *, const char *, int, const char *, const char *, ...);
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(void *, fmi2Status);
  void *componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
  fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged,
      valuesOfContinuousStatesChanged, nextEventTimeDefined;
  double nextEventTime;
} fmi2EventInfo;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(Instance *c, fmi2Boolean on, size_t n, const char *const categories[]) {
  return set_logging(c, on, n, categories);
}

EXPORT Instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                 const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                 fmi2Boolean logging) {
  (void)resources;
  (void)visible;
  Instance *c = instantiate(name, token, 2, type == 0, logging, functions ? functions->componentEnvironment : 0);
  if (!c) return 0;
  c->log2 = functions ? functions->logger : 0;
  if (!token || strcmp(token, TOKEN)) {
    report(c, ERROR, "%s: wrong GUID: the FMU has %s, the importer passed %s", MODEL, TOKEN, token ? token : "(null)");
    release(c);
    return 0;
  }
  return c;
}

EXPORT void fmi2FreeInstance(Instance *c) { release(c); }

EXPORT fmi2Status fmi2SetupExperiment(Instance *c, fmi2Boolean tolerance_defined, double tolerance, double start,
                                      fmi2Boolean stop_defined, double stop) {
  (void)tolerance_defined;
  (void)tolerance;
  if (c->m.mode != INSTANTIATED) return report(c, ERROR, "%s: the FMU is already initialized", MODEL);
  if (!isfinite(start)) return report(c, ERROR, "%s: start time %g is not finite", MODEL, start);
  if (stop_defined && !(stop >= start))
    return report(c, ERROR, "%s: the stop time %g s lies before the start time %g s", MODEL, stop, start);
  c->m.v[0] = start;
  c->m.stop = stop_defined ? stop : INFINITY;
  c->m.stale = ALL;
  return OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(Instance *c) { return enter_initialization(c); }

EXPORT fmi2Status fmi2ExitInitializationMode(Instance *c) { return leave_initialization(c); }

EXPORT fmi2Status fmi2Terminate(Instance *c) { return terminate(c); }

EXPORT fmi2Status fmi2Reset(Instance *c) {
#if INTERMEDIATE
  if (c->m.mode == UPDATING) return only_in(c, 0, "a reset");
#endif
  set_start(c);
  return OK;
}

EXPORT fmi2Status fmi2GetReal(Instance *c, const uint32_t vr[], size_t n, double values[]) {
  return get_values(c, vr, n, values);
}

EXPORT fmi2Status fmi2SetReal(Instance *c, const uint32_t vr[], size_t n, const double values[]) {
  return set_values(c, vr, n, values);
}

EXPORT fmi2Status fmi2GetInteger(Instance *c, const uint32_t vr[], size_t n, int values[]) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] != METHOD) return report(c, ERROR, "%s: value reference %u is no Integer", MODEL, vr[i]);
    values[i] = (int)c->m.v[METHOD];
  }
  return OK;
}

EXPORT fmi2Status fmi2SetInteger(Instance *c, const uint32_t vr[], size_t n, const int values[]) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] != METHOD) return report(c, ERROR, "%s: value reference %u is no Integer", MODEL, vr[i]);
    if (c->m.mode >= TERMINATED) return only_in(c, 0, "setting a value");
    const int status = set_value(c, METHOD, values[i]);
    if (status != OK) return status;
  }
  return OK;
}

static fmi2Status none2(Instance *c, size_t n, const char *type) {
  return n ? report(c, ERROR, "%s: the FMU has no %s variables", MODEL, type) : OK;
}

EXPORT fmi2Status fmi2GetBoolean(Instance *c, const uint32_t vr[], size_t n, fmi2Boolean values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "Boolean");
}

EXPORT fmi2Status fmi2SetBoolean(Instance *c, const uint32_t vr[], size_t n, const fmi2Boolean values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "Boolean");
}

EXPORT fmi2Status fmi2GetString(Instance *c, const uint32_t vr[], size_t n, const char *values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "String");
}

EXPORT fmi2Status fmi2SetString(Instance *c, const uint32_t vr[], size_t n, const char *const values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "String");
}

EXPORT fmi2Status fmi2GetFMUstate(Instance *c, void **state) { return save_state(c, state); }

EXPORT fmi2Status fmi2SetFMUstate(Instance *c, void *state) {
#if INTERMEDIATE
  if (c->m.mode == UPDATING) return only_in(c, 0, "restoring a state");
#endif
  if (!state) return report(c, ERROR, "%s: no state given", MODEL);
  memcpy(&c->m, state, sizeof(Memory));
  return OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(Instance *c, void **state) {
  (void)c;
  if (state) {
    free(*state);
    *state = 0;
  }
  return OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(Instance *c, void *state, size_t *size) {
  (void)c;
  (void)state;
  *size = TOKEN_BYTES + sizeof(Memory);
  return OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(Instance *c, void *state, uint8_t bytes[], size_t size) {
  return serialize(c, state, bytes, size);
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(Instance *c, const uint8_t bytes[], size_t size, void **state) {
  return deserialize(c, bytes, size, state);
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(Instance *c, const uint32_t unknowns[], size_t nu,
                                               const uint32_t knowns[], size_t nk, const double seed[],
                                               double result[]) {
  return directional(c, unknowns, nu, knowns, nk, seed, result);
}

/* model exchange */

EXPORT fmi2Status fmi2EnterEventMode(Instance *c) {
  return change_mode(c, CONTINUOUS, EVENT, "entering event mode");
}

EXPORT fmi2Status fmi2NewDiscreteStates(Instance *c, fmi2EventInfo *info) {
  memset(info, 0, sizeof *info);
  const int status = only_in(c, IN(EVENT), "updating discrete states");
  if (status != OK) return status;
  run_ticks(c);
  const double next = next_tick(c, INFINITY);
  info->nextEventTimeDefined = isfinite(next);
  info->nextEventTime = isfinite(next) ? next : 0;
  return check_finite(c, IZ, NZ);
}

EXPORT fmi2Status fmi2EnterContinuousTimeMode(Instance *c) {
  return change_mode(c, EVENT, CONTINUOUS, "entering continuous-time mode");
}

static int completed_step(Instance *c) {
  const int status = only_in(c, IN(CONTINUOUS), "completing an integrator step");
  return status == OK ? check_finite(c, IX, NX) : status;
}

EXPORT fmi2Status fmi2CompletedIntegratorStep(Instance *c, fmi2Boolean no_rollback, fmi2Boolean *event,
                                              fmi2Boolean *terminate) {
  (void)no_rollback;
  *event = 0;
  *terminate = 0;
  return completed_step(c);
}

EXPORT fmi2Status fmi2SetTime(Instance *c, double time) { return set_time(c, time); }

static int set_states(Instance *c, const double x[], size_t n) {
  const int status = only_in(c, IN(CONTINUOUS), "setting continuous states");
  if (status != OK) return status;
  if (n != NX) return report(c, ERROR, "%s: %zu states given, the FMU has %d", MODEL, n, NX);
  for (size_t i = 0; i < n; i++) c->m.v[IX + i] = x[i];
  c->m.stale = ALL;
  return check_finite(c, IX, NX);
}

static int copy_out(Instance *c, int from, double values[], size_t n, size_t expected) {
  if (n != expected) return report(c, ERROR, "%s: %zu values asked for, the FMU has %zu", MODEL, n, expected);
  for (size_t i = 0; i < n; i++) values[i] = c->m.v[from + i];
  return OK;
}

EXPORT fmi2Status fmi2SetContinuousStates(Instance *c, const double x[], size_t n) { return set_states(c, x, n); }

EXPORT fmi2Status fmi2GetDerivatives(Instance *c, double xdot[], size_t n) {
  refresh(c);
  const int status = copy_out(c, IXD, xdot, n, NX);
  return status == OK ? check_finite(c, IXD, NX) : status;
}

EXPORT fmi2Status fmi2GetEventIndicators(Instance *c, double values[], size_t n) {
  (void)values;
  return n ? report(c, ERROR, "%s: the FMU has no event indicators", MODEL) : OK;
}

EXPORT fmi2Status fmi2GetContinuousStates(Instance *c, double x[], size_t n) { return copy_out(c, IX, x, n, NX); }

EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(Instance *c, double nominal[], size_t n) {
  if (n != NX) return report(c, ERROR, "%s: %zu nominals asked for, the FMU has %d", MODEL, n, NX);
  for (size_t i = 0; i < n; i++) nominal[i] = NOMINAL[i];
  return OK;
}

/* co-simulation */

EXPORT fmi2Status fmi2DoStep(Instance *c, double t, double h, fmi2Boolean no_rollback) {
  (void)no_rollback;
  return do_step(c, t, h);
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(Instance *c, const uint32_t vr[], size_t n, const int order[],
                                              const double values[]) {
  return set_input_derivatives(c, vr, n, order, values);
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(Instance *c, const uint32_t vr[], size_t n, const int order[],
                                               double values[]) {
  (void)vr;
  (void)order;
  (void)values;
  return n ? report(c, ERROR, "%s: output derivatives are not provided", MODEL) : OK;
}

EXPORT fmi2Status fmi2CancelStep(Instance *c) { return report(c, ERROR, "%s: steps are not asynchronous", MODEL); }

EXPORT fmi2Status fmi2GetStatus(Instance *c, int kind, fmi2Status *value) {
  (void)kind;
  (void)value;
  return report(c, DISCARD, "%s: steps are not asynchronous", MODEL);
}

EXPORT fmi2Status fmi2GetRealStatus(Instance *c, int kind, double *value) {
  if (kind != 2) return report(c, DISCARD, "%s: status kind %d is no Real", MODEL, kind);
  *value = c->m.v[0];
  return OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(Instance *c, int kind, int *value) {
  (void)value;
  return report(c, DISCARD, "%s: status kind %d is no Integer", MODEL, kind);
}

EXPORT fmi2Status fmi2GetBooleanStatus(Instance *c, int kind, fmi2Boolean *value) {
  if (kind != 3) return report(c, DISCARD, "%s: status kind %d is no Boolean", MODEL, kind);
  *value = 0;
  return OK;
}

EXPORT fmi2Status fmi2GetStringStatus(Instance *c, int kind, const char **value) {
  (void)value;
  return report(c, DISCARD, "%s: status kind %d is no String", MODEL, kind);
}
