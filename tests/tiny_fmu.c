/* Shell of an FMU for tests, of FMI 2 (FMI = 2) or 3: variable number v of the description has the
   values n[v] (integers, truth values) or r[v] (floating-point numbers) or s[v] (strings, binaries).
   OUTPUTS and STEP are statements on them; `tiny_fmus.py` defines both, and SIZES. */
#include <stdarg.h>
#include <stdint.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define VARIABLES 32
#define ELEMENTS 16
#define TEXT 256

typedef struct {
  double r[VARIABLES][ELEMENTS], t, stop, last;
  int64_t n[VARIABLES][ELEMENTS];
  char s[VARIABLES][TEXT];
  size_t length[VARIABLES];
  bool final, end, begun; /* final: noSetFMUStatePriorToCurrentPoint of the present step */
  bool soon;    /* the step returns early, at `last` (FMI 3) */
  int set_code; /* status of all set calls */
} Values;

typedef struct {
  Values v;
  void *environment;
  void (*log)();
  void (*update)(void *, double, bool, bool, bool, bool, bool *, double *);
  size_t required; /* number of inputs that the master sets within steps */
} Model;

typedef uint32_t Ref;
static const size_t SIZE[VARIABLES] = SIZES;

static void say(Model *m, int status, const char *text) {
#if FMI == 2
  ((void (*)(void *, const char *, int, const char *, const char *, ...))m->log)(m->environment, "m", status, "log", "%s", text);
#else
  ((void (*)(void *, int, const char *, const char *))m->log)(m->environment, status, "log", text);
#endif
}

static void outputs(Model *m) {
  Values *v = &m->v;
  (void)v;
  OUTPUTS;
}

/* Say within a step that it is at time t, with a wish for inputs or without (FMI 3). */
static void tell(Model *m, double t, bool wanted, bool finished) {
  bool early = true;
  double when = -1;
  if (m->update) m->update(m->environment, t, wanted, false, finished, false, &early, &when);
  if (m->update && early) abort(); /* nobody wants this FMU to return early */
}

static void ask(Model *m, double t, bool finished) { tell(m, t, true, finished); }

/* The same from another thread. */
extern int pthread_create(unsigned long *, const void *, void *(*)(void *), void *) __attribute__((weak));
extern int pthread_join(unsigned long, void **) __attribute__((weak));
typedef struct {
  Model *m;
  double t;
} Question;
static void *ask_it(void *question) {
  const Question *const q = question;
  ask(q->m, q->t, false);
  return 0;
}
static void ask_in_thread(Model *m, double t) {
  Question question = {m, t};
  unsigned long thread;
  if (pthread_create(&thread, 0, ask_it, &question)) abort();
  pthread_join(thread, 0);
}

static int do_step(Model *m, double t, double h) {
  Values *v = &m->v;
  (void)h;
  v->begun = true;
  STEP;
  v->t = t + h;
  return 0;
}

static Model *create(void) {
  Model *m = calloc(1, sizeof *m);
  START(m->v);
  return m;
}

static size_t size(Ref v) { return SIZE[v] ? SIZE[v] : 1; }

#define NUMBERS(get, set, type, field) \
  EXPORT int get(Model *m, const Ref *v, size_t nv, type *out LENGTH) { \
    outputs(m); \
    for (size_t i = 0; i < nv; i++) \
      for (size_t k = 0; k < size(v[i]); k++) *out++ = (type)m->v.field[v[i]][k]; \
    return 0; \
  } \
  EXPORT int set(Model *m, const Ref *v, size_t nv, const type *in LENGTH) { \
    for (size_t i = 0; i < nv; i++) \
      for (size_t k = 0; k < size(v[i]); k++) m->v.field[v[i]][k] = *in++; \
    return m->v.set_code; \
  }

static void keep(Model *m, Ref v, const void *text, size_t length) {
  m->v.length[v] = length < TEXT - 1 ? length : TEXT - 1;
  memcpy(m->v.s[v], text, m->v.length[v]);
  m->v.s[v][m->v.length[v]] = 0;
}

#if FMI == 2
#define LENGTH
#define NAME(f) fmi2##f
#define STATE(f) fmi2##f##FMUstate
EXPORT Model *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void **callbacks, int v, int l) {
  Model *m = create();
  m->log = callbacks[0];
  m->environment = callbacks[4];
  return m;
}
EXPORT int fmi2SetupExperiment(Model *m, int d, double tol, double start, int has, double stop) {
  m->v.t = start;
  m->v.stop = has ? stop : 1e300;
  return 0;
}
EXPORT int fmi2EnterInitializationMode(Model *m) { return 0; }
EXPORT int fmi2DoStep(Model *m, double t, double h, int final) {
  m->v.final = final;
  const int status = do_step(m, t, h);
  return m->v.end ? 2 : status;
}
EXPORT int fmi2GetBooleanStatus(Model *m, int kind, int *value) { *value = m->v.end; return 0; }
EXPORT int fmi2GetRealStatus(Model *m, int kind, double *value) { *value = m->v.last; return 0; }
NUMBERS(fmi2GetReal, fmi2SetReal, double, r)
NUMBERS(fmi2GetInteger, fmi2SetInteger, int, n)
NUMBERS(fmi2GetBoolean, fmi2SetBoolean, int, n)
#else
#define LENGTH , size_t count
#define NAME(f) fmi3##f
#define STATE(f) fmi3##f##FMUState
EXPORT Model *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool v, bool l, bool e, bool early,
    const Ref *required, size_t nr, void *environment, void (*log)(), void *update) {
  Model *m = create();
  m->log = log;
  m->environment = environment;
  m->update = (void (*)(void *, double, bool, bool, bool, bool, bool *, double *))update;
  m->required = nr;
  return m;
}
EXPORT int fmi3EnterInitializationMode(Model *m, bool d, double tol, double start, bool has, double stop) {
  m->v.t = start;
  m->v.stop = has ? stop : 1e300;
  return 0;
}
EXPORT int fmi3DoStep(Model *m, double t, double h, bool final, bool *event, bool *end, bool *early, double *last) {
  m->v.final = final;
  *event = *early = false;
  const int status = do_step(m, t, h);
  *end = m->v.end;
  *early = m->v.soon;
  *last = m->v.end || m->v.soon ? m->v.last : t + h;
  return status;
}
NUMBERS(fmi3GetFloat64, fmi3SetFloat64, double, r)
NUMBERS(fmi3GetFloat32, fmi3SetFloat32, float, r)
NUMBERS(fmi3GetInt8, fmi3SetInt8, int8_t, n)
NUMBERS(fmi3GetUInt8, fmi3SetUInt8, uint8_t, n)
NUMBERS(fmi3GetInt16, fmi3SetInt16, int16_t, n)
NUMBERS(fmi3GetUInt16, fmi3SetUInt16, uint16_t, n)
NUMBERS(fmi3GetInt32, fmi3SetInt32, int32_t, n)
NUMBERS(fmi3GetUInt32, fmi3SetUInt32, uint32_t, n)
NUMBERS(fmi3GetInt64, fmi3SetInt64, int64_t, n)
NUMBERS(fmi3GetUInt64, fmi3SetUInt64, uint64_t, n)
NUMBERS(fmi3GetBoolean, fmi3SetBoolean, bool, n)
EXPORT int fmi3GetBinary(Model *m, const Ref *v, size_t nv, size_t *lengths, const char **out, size_t count) {
  outputs(m);
  for (size_t i = 0; i < nv; i++) out[i] = m->v.s[v[i]], lengths[i] = m->v.length[v[i]];
  return 0;
}
EXPORT int fmi3SetBinary(Model *m, const Ref *v, size_t nv, const size_t *lengths, const char *const *in, size_t count) {
  for (size_t i = 0; i < nv; i++) keep(m, v[i], in[i], lengths[i]);
  return 0;
}
#endif

EXPORT int NAME(GetString)(Model *m, const Ref *v, size_t nv, const char **out LENGTH) {
  outputs(m);
  for (size_t i = 0; i < nv; i++) out[i] = m->v.s[v[i]];
  return 0;
}
EXPORT int NAME(SetString)(Model *m, const Ref *v, size_t nv, const char *const *in LENGTH) {
  for (size_t i = 0; i < nv; i++) keep(m, v[i], in[i], strlen(in[i]));
  return 0;
}
EXPORT int NAME(ExitInitializationMode)(Model *m) { return 0; }
EXPORT int NAME(Terminate)(Model *m) { return 0; }
EXPORT int NAME(Reset)(Model *m) {
  memset(&m->v, 0, sizeof m->v);
  START(m->v);
  return 0;
}
EXPORT void NAME(FreeInstance)(Model *m) { free(m); }
EXPORT int STATE(Get)(Model *m, Values **state) {
  if (!*state) *state = malloc(sizeof **state);
  **state = m->v;
  return 0;
}
/* That going back was ruled out is an error of the master. */
EXPORT int STATE(Set)(Model *m, const Values *state) {
  if (m->v.begun && m->v.final && state->t < m->v.t) {
    say(m, 3, "a state from before the step, which was said to be final");
    return 3;
  }
  m->v = *state;
  return 0;
}
EXPORT int STATE(Free)(Model *m, Values **state) {
  free(*state);
  *state = 0;
  return 0;
}
