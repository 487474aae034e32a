/* FMI 3.0, co-simulation and model exchange; declarations follow the standard, section 2 to 4. */

typedef int fmi3Status;
typedef bool fmi3Boolean;
typedef void (*fmi3LogMessageCallback)(void *, int, const char *, const char *);

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Status fmi3SetDebugLogging(Instance *c, fmi3Boolean on, size_t n, const char *const categories[]) {
  return set_logging(c, on, n, categories);
}

static Instance *instantiate3(const char *name, const char *token, int model_exchange, fmi3Boolean logging,
                              void *environment, fmi3LogMessageCallback log) {
  Instance *c = instantiate(name, token, 3, model_exchange, logging, environment);
  if (!c) return 0;
  c->log3 = log;
  if (!token || strcmp(token, TOKEN)) {
    report(c, ERROR, "%s: wrong instantiation token: the FMU has %s, the importer passed %s", MODEL, TOKEN,
           token ? token : "(null)");
    release(c);
    return 0;
  }
  return c;
}

EXPORT Instance *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources,
                                              fmi3Boolean visible, fmi3Boolean logging, void *environment,
                                              fmi3LogMessageCallback log) {
  (void)resources;
  (void)visible;
  return instantiate3(name, token, 1, logging, environment, log);
}

EXPORT Instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                             fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                             fmi3Boolean early_return, const uint32_t required[], size_t n,
                                             void *environment, fmi3LogMessageCallback log, void *update) {
  (void)resources;
  (void)visible;
  (void)early_return;
#if INTERMEDIATE
  Instance *c = instantiate3(name, token, 0, logging, environment, log);
  if (!c) return 0;
  for (size_t i = 0; i < n; i++)
    if (required[i] - c->first < IU || required[i] - c->first >= IY) {
      report(c, ERROR, "%s: value reference %u is among the required intermediate variables and has no "
             "intermediateUpdate; only inputs have", MODEL, required[i]);
      release(c);
      return 0;
    }
  c->event_mode = event_mode;
  c->update = (void (*)(void *, double, bool, bool, bool, bool, bool *, double *))update;
  c->required = update ? n : 0;
  return c;
#else
  (void)required;
  (void)n;
  (void)update;
  Instance *c = instantiate3(name, token, 0, logging, environment, log);
  if (c) c->event_mode = event_mode;
  return c;
#endif
}

EXPORT Instance *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources,
                                                   fmi3Boolean visible, fmi3Boolean logging, void *environment,
                                                   fmi3LogMessageCallback log, void *update, void *lock,
                                                   void *unlock) {
  (void)name;
  (void)token;
  (void)resources;
  (void)visible;
  (void)logging;
  (void)update;
  (void)lock;
  (void)unlock;
  if (log) log(environment, ERROR, "logStatusError", "scheduled execution is not provided");
  return 0;
}

EXPORT void fmi3FreeInstance(Instance *c) { release(c); }

EXPORT fmi3Status fmi3EnterInitializationMode(Instance *c, fmi3Boolean tolerance_defined, double tolerance,
                                              double start, fmi3Boolean stop_defined, double stop) {
  const int status = fmi2SetupExperiment(c, tolerance_defined, tolerance, start, stop_defined, stop);
  return status == OK ? fmi2EnterInitializationMode(c) : status;
}

EXPORT fmi3Status fmi3ExitInitializationMode(Instance *c) { return leave_initialization(c); }
EXPORT fmi3Status fmi3EnterEventMode(Instance *c) {
  return c->event_mode ? change_mode(c, STEPPING, EVENT, "entering event mode") : fmi2EnterEventMode(c);
}
EXPORT fmi3Status fmi3Terminate(Instance *c) { return fmi2Terminate(c); }
EXPORT fmi3Status fmi3Reset(Instance *c) { return fmi2Reset(c); }

EXPORT fmi3Status fmi3GetFloat64(Instance *c, const uint32_t vr[], size_t n, double values[], size_t nv) {
  if (nv != n) return report(c, ERROR, "%s: %zu values for %zu variables", MODEL, nv, n);
  return get_values(c, vr, n, values);
}

EXPORT fmi3Status fmi3SetFloat64(Instance *c, const uint32_t vr[], size_t n, const double values[], size_t nv) {
  if (nv != n) return report(c, ERROR, "%s: %zu values for %zu variables", MODEL, nv, n);
  return set_values(c, vr, n, values);
}

EXPORT fmi3Status fmi3GetInt64(Instance *c, const uint32_t vr[], size_t n, int64_t values[], size_t nv) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] != METHOD + c->first || nv != n) return report(c, ERROR, "%s: value reference %u is no Int64", MODEL, vr[i]);
    values[i] = (int64_t)c->m.v[METHOD];
  }
  return OK;
}

EXPORT fmi3Status fmi3SetInt64(Instance *c, const uint32_t vr[], size_t n, const int64_t values[], size_t nv) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] != METHOD + c->first || nv != n) return report(c, ERROR, "%s: value reference %u is no Int64", MODEL, vr[i]);
    if (c->m.mode >= TERMINATED) return only_in(c, 0, "setting a value");
    const int status = set_value(c, METHOD, (double)values[i]);
    if (status != OK) return status;
  }
  return OK;
}

#define NO_VARIABLES(Type, ctype)                                                                       \
  EXPORT fmi3Status fmi3Get##Type(Instance *c, const uint32_t vr[], size_t n, ctype values[], size_t nv) { \
    (void)vr;                                                                                           \
    (void)values;                                                                                       \
    (void)nv;                                                                                           \
    return none2(c, n, #Type);                                                                          \
  }                                                                                                     \
  EXPORT fmi3Status fmi3Set##Type(Instance *c, const uint32_t vr[], size_t n, const ctype values[], size_t nv) { \
    (void)vr;                                                                                           \
    (void)values;                                                                                       \
    (void)nv;                                                                                           \
    return none2(c, n, #Type);                                                                          \
  }

NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)

typedef const char *String;
NO_VARIABLES(String, String)

EXPORT fmi3Status fmi3GetBinary(Instance *c, const uint32_t vr[], size_t n, size_t sizes[],
                                const uint8_t *values[], size_t nv) {
  (void)vr;
  (void)sizes;
  (void)values;
  (void)nv;
  return none2(c, n, "Binary");
}

EXPORT fmi3Status fmi3SetBinary(Instance *c, const uint32_t vr[], size_t n, const size_t sizes[],
                                const uint8_t *const values[], size_t nv) {
  (void)vr;
  (void)sizes;
  (void)values;
  (void)nv;
  return none2(c, n, "Binary");
}

EXPORT fmi3Status fmi3GetClock(Instance *c, const uint32_t vr[], size_t n, bool values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "Clock");
}

EXPORT fmi3Status fmi3SetClock(Instance *c, const uint32_t vr[], size_t n, const bool values[]) {
  (void)vr;
  (void)values;
  return none2(c, n, "Clock");
}

EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(Instance *c, uint32_t vr, size_t *n) {
  (void)vr;
  (void)n;
  return report(c, ERROR, "%s: dependencies are declared in the model description", MODEL);
}

EXPORT fmi3Status fmi3GetVariableDependencies(Instance *c, uint32_t dependent, size_t element_of_dependent[],
                                              uint32_t independents[], size_t element_of_independents[],
                                              int kinds[], size_t n) {
  (void)dependent;
  (void)element_of_dependent;
  (void)independents;
  (void)element_of_independents;
  (void)kinds;
  (void)n;
  return report(c, ERROR, "%s: dependencies are declared in the model description", MODEL);
}

EXPORT fmi3Status fmi3GetFMUState(Instance *c, void **state) { return save_state(c, state); }
EXPORT fmi3Status fmi3SetFMUState(Instance *c, void *state) { return fmi2SetFMUstate(c, state); }
EXPORT fmi3Status fmi3FreeFMUState(Instance *c, void **state) { return fmi2FreeFMUstate(c, state); }

EXPORT fmi3Status fmi3SerializedFMUStateSize(Instance *c, void *state, size_t *size) {
  return fmi2SerializedFMUstateSize(c, state, size);
}

EXPORT fmi3Status fmi3SerializeFMUState(Instance *c, void *state, uint8_t bytes[], size_t size) {
  return serialize(c, state, bytes, size);
}

EXPORT fmi3Status fmi3DeserializeFMUState(Instance *c, const uint8_t bytes[], size_t size, void **state) {
  return deserialize(c, bytes, size, state);
}

EXPORT fmi3Status fmi3GetDirectionalDerivative(Instance *c, const uint32_t unknowns[], size_t nu,
                                               const uint32_t knowns[], size_t nk, const double seed[],
                                               size_t n_seed, double result[], size_t n_result) {
  if (n_seed != nk || n_result != nu)
    return report(c, ERROR, "%s: %zu seeds for %zu knowns, %zu results for %zu unknowns", MODEL, n_seed, nk,
                  n_result, nu);
  return directional(c, unknowns, nu, knowns, nk, seed, result);
}

EXPORT fmi3Status fmi3GetAdjointDerivative(Instance *c, const uint32_t unknowns[], size_t nu,
                                           const uint32_t knowns[], size_t nk, const double seed[], size_t n_seed,
                                           double result[], size_t n_result) {
  (void)unknowns;
  (void)nu;
  (void)knowns;
  (void)nk;
  (void)seed;
  (void)n_seed;
  (void)result;
  (void)n_result;
  return report(c, ERROR, "%s: adjoint derivatives are not provided", MODEL);
}

EXPORT fmi3Status fmi3EnterConfigurationMode(Instance *c) {
  return report(c, ERROR, "%s: there are no structural parameters", MODEL);
}

EXPORT fmi3Status fmi3ExitConfigurationMode(Instance *c) {
  return report(c, ERROR, "%s: there are no structural parameters", MODEL);
}

#define NO_CLOCK_DECIMAL(Name, qualifier)                                                               \
  EXPORT fmi3Status Name(Instance *c, const uint32_t vr[], size_t n, qualifier double values[]) {       \
    (void)vr;                                                                                           \
    (void)values;                                                                                       \
    return none2(c, n, "Clock");                                                                        \
  }
#define NO_CLOCK_FRACTION(Name, qualifier)                                                              \
  EXPORT fmi3Status Name(Instance *c, const uint32_t vr[], size_t n, qualifier uint64_t counters[],     \
                         qualifier uint64_t resolutions[]) {                                            \
    (void)vr;                                                                                           \
    (void)counters;                                                                                     \
    (void)resolutions;                                                                                  \
    return none2(c, n, "Clock");                                                                        \
  }

EXPORT fmi3Status fmi3GetIntervalDecimal(Instance *c, const uint32_t vr[], size_t n, double intervals[],
                                         int qualifiers[]) {
  (void)vr;
  (void)intervals;
  (void)qualifiers;
  return none2(c, n, "Clock");
}

EXPORT fmi3Status fmi3GetIntervalFraction(Instance *c, const uint32_t vr[], size_t n, uint64_t counters[],
                                          uint64_t resolutions[], int qualifiers[]) {
  (void)vr;
  (void)counters;
  (void)resolutions;
  (void)qualifiers;
  return none2(c, n, "Clock");
}

NO_CLOCK_DECIMAL(fmi3GetShiftDecimal, )
NO_CLOCK_FRACTION(fmi3GetShiftFraction, )
NO_CLOCK_DECIMAL(fmi3SetIntervalDecimal, const)
NO_CLOCK_FRACTION(fmi3SetIntervalFraction, const)
NO_CLOCK_DECIMAL(fmi3SetShiftDecimal, const)
NO_CLOCK_FRACTION(fmi3SetShiftFraction, const)

EXPORT fmi3Status fmi3EvaluateDiscreteStates(Instance *c) {
  return report(c, ERROR, "%s: evaluating discrete states is not provided", MODEL);
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(Instance *c, fmi3Boolean *needed, fmi3Boolean *terminate,
                                           fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next_defined,
                                           double *next) {
  fmi2EventInfo info;
  const int status = fmi2NewDiscreteStates(c, &info);
  *needed = *terminate = *nominals = *values = false;
  *next_defined = info.nextEventTimeDefined;
  *next = info.nextEventTime;
  return status;
}

EXPORT fmi3Status fmi3EnterContinuousTimeMode(Instance *c) {
  if (!c->model_exchange) return report(c, ERROR, "%s: co-simulation has no continuous-time mode", MODEL);
  return fmi2EnterContinuousTimeMode(c);
}

EXPORT fmi3Status fmi3CompletedIntegratorStep(Instance *c, fmi3Boolean no_rollback, fmi3Boolean *event,
                                              fmi3Boolean *terminate) {
  (void)no_rollback;
  *event = *terminate = false;
  return completed_step(c);
}

EXPORT fmi3Status fmi3SetTime(Instance *c, double time) { return fmi2SetTime(c, time); }
EXPORT fmi3Status fmi3SetContinuousStates(Instance *c, const double x[], size_t n) { return set_states(c, x, n); }

EXPORT fmi3Status fmi3GetContinuousStateDerivatives(Instance *c, double xdot[], size_t n) {
  return fmi2GetDerivatives(c, xdot, n);
}

EXPORT fmi3Status fmi3GetEventIndicators(Instance *c, double values[], size_t n) {
  return fmi2GetEventIndicators(c, values, n);
}

EXPORT fmi3Status fmi3GetContinuousStates(Instance *c, double x[], size_t n) { return copy_out(c, IX, x, n, NX); }

EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(Instance *c, double nominal[], size_t n) {
  return fmi2GetNominalsOfContinuousStates(c, nominal, n);
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(Instance *c, size_t *n) {
  (void)c;
  *n = 0;
  return OK;
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(Instance *c, size_t *n) {
  (void)c;
  *n = NX;
  return OK;
}

EXPORT fmi3Status fmi3EnterStepMode(Instance *c) {
  if (!c->event_mode) return report(c, ERROR, "%s: no event mode is used that could be left", MODEL);
  return change_mode(c, EVENT, STEPPING, "entering step mode");
}

EXPORT fmi3Status fmi3GetOutputDerivatives(Instance *c, const uint32_t vr[], size_t n, const int32_t order[],
                                           double values[], size_t nv) {
  (void)nv;
  return fmi2GetRealOutputDerivatives(c, vr, n, (const int *)order, values);
}

EXPORT fmi3Status fmi3DoStep(Instance *c, double t, double h, fmi3Boolean no_rollback, fmi3Boolean *event,
                             fmi3Boolean *terminate, fmi3Boolean *early, double *last) {
  (void)no_rollback;
  const int status = do_step(c, t, h);
  if (event) *event = c->event_mode && status == OK && tick_due(c);
  if (terminate) *terminate = false;
  if (early) *early = false;
  if (last) *last = c->m.v[0];
  return status;
}

EXPORT fmi3Status fmi3ActivateModelPartition(Instance *c, uint32_t clock, double time) {
  (void)clock;
  (void)time;
  return report(c, ERROR, "%s: scheduled execution is not provided", MODEL);
}
