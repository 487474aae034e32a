/* One FMU instance: its variables, how they are set and read, its saved states. Included by all.c
   after the generated model.c, which defines the sizes NX NU NY NP NZ NC NK, the tables and the functions
   f_…; solvers.c and steps.c follow.

   All variables stand in one array v of doubles; the value reference of a variable is its index, in
   FMI 3 one more:
   [time, x, xdot, u, y, p, z, solver.method, solver.step, solver.tolerance].
   Everything that a saved state must hold is in Memory, a plain struct. */

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { IX = 1, IXD = IX + NX, IU = IXD + NX, IY = IU + NU, IP = IY + NY, IZ = IP + NP, IS = IZ + NZ };
enum { NV = IS + 3 };
enum { METHOD = IS, STEP = IS + 1, TOLERANCE = IS + 2 };
enum { RK4 = 1, RODAS3 = 2, DOPRI5 = 3, RODAS3_ADAPTIVE = 4, ROSW3_ADAPTIVE = 5 };
#if INTERMEDIATE
enum { INSTANTIATED, INITIALIZING, EVENT, CONTINUOUS, STEPPING, UPDATING, TERMINATED, FAILED };
/* What was evaluated is of the begin of a step within which inputs are set. */
#define UPDATED(c) ((c)->m.mode == UPDATING)
#else
#define UPDATED(c) 0
enum { INSTANTIATED, INITIALIZING, EVENT, CONTINUOUS, STEPPING, TERMINATED, FAILED };
#endif
enum { OK, WARNING, DISCARD, ERROR, FATAL };

/* What every call looks at comes first: it shares the cache lines of the first variables. */
typedef struct {
  int32_t mode;
  int32_t stale;         /* which outputs and derivatives must be evaluated again, see below */
  int32_t moving;        /* inputs have been given derivatives */
  int32_t left;          /* for how many steps the Jacobian may still serve */
  double v[NV];
  double period[NC + 1]; /* of each sample clock; depends on fixed parameters only */
  double tick[NC + 1];   /* index of the next tick of each clock */
  double next[NC + 1];   /* its time */
  double stop;           /* where the importer says that the simulation ends */
  double h;              /* last accepted step of an error-controlled solver, 0: none yet */
  double j[NJ + 1];      /* Jacobian that is kept, and the factors of its matrix */
  double w[NLU + 1];
  double hw;             /* the step that they are for, of ROS34PW2 > 0, of Rodas3 < 0 */
  double k[NK + 1];      /* what depends on parameters only */
  double slope[NU + 1];  /* first derivatives of the inputs at the present time */
  double curve[NU + 1];  /* second derivatives */
} Memory;

typedef struct {
  uint32_t first; /* value reference of the time */
  int version;
  int64_t work; /* steps of solvers so far: what an importer may limit, where time would depend on the machine */
  Memory m;
  int model_exchange;
  int event_mode; /* of co-simulation, FMI 3: the importer may ask for the ticks at its points */
  int logging;
  char *name;
  void *environment;
  void (*log2)(void *, const char *, int, const char *, const char *, ...);
  void (*log3)(void *, int, const char *, const char *);
#if INTERMEDIATE
  void (*update)(void *, double, bool, bool, bool, bool, bool *, double *); /* asks the importer for inputs */
  size_t required; /* number of inputs that it sets within steps */
  double asked;    /* time of the present inputs */
#endif
} Instance;

/* Log a message and return its status. FMI 2 takes the text as a format: no % may be left in it. */
static int report(Instance *c, int status, const char *format, ...) {
  char text[512], escaped[1024];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  const char *category = status == ERROR ? "logStatusError" : "logStatusDiscard";
  if (c->version == 2 && c->log2) {
    char *to = escaped;
    for (const char *from = text; *from; from++) {
      *to++ = *from;
      if (*from == '%') *to++ = '%';
    }
    *to = 0;
    c->log2(c->environment, c->name, status, category, escaped);
  }
  if (c->version == 3 && c->log3) c->log3(c->environment, status, category, text);
  return status;
}

static const char *const MODE_NAMES[] = {"not initialized", "in initialization mode", "in event mode",
#if INTERMEDIATE
                                         "in continuous-time mode", "in step mode",
                                         "in intermediate update mode", "terminated",
#else
                                         "in continuous-time mode", "in step mode", "terminated",
#endif
                                         "stopped by a failed step"};
#define IN(mode) (1u << (mode))

/* Refuse a call in a mode in which the standards do not allow it. */
static int only_in(Instance *c, unsigned modes, const char *call) {
  if (modes & IN(c->m.mode)) return OK;
  return report(c, ERROR, "%s: %s is not allowed while the FMU is %s", MODEL, call, MODE_NAMES[c->m.mode]);
}

/* -- model functions ------------------------------------------------------------------------ */

/* What is stale: everything, everything but what costs nothing, only the energies that nobody is coupled by. */
enum { FRESH, ALL, QUICK_DONE, COUPLED_DONE };

/* Where derivatives go: without states to no place that arguments share. */
#define RATES(v, none) (NX ? (v) + IXD : (none))

static void evaluate_outputs(Memory *m) {
  double *v = m->v, none[1];
  f_outputs(v, v + IX, v + IZ, v + IU, v + IP, m->k, RATES(v, none), v + IY);
  m->stale = FRESH;
}

#if INTERMEDIATE
static inline Instance *owner(const Memory *memory) {
  return (Instance *)((char *)memory - offsetof(Instance, m));
}

/* Intermediate update: the importer sets the inputs of time t. Of an importer that declares none of them it
   is asked at the end of a stretch only. */
static void ask(Instance *c, double t, bool finished) {
  if (!c->update || (!finished && (!c->required || t == c->asked))) return;
  bool early = false;
  double when = t;
  c->m.mode = UPDATING;
  c->update(c->environment, t, c->required > 0, false, finished, false, &early, &when);
  c->m.mode = STEPPING;
  c->asked = t;
}

#endif
/* Inputs at time t: held, or u + u' dt + u'' dt^2/2 from the present time on. */
static const double *inputs_at(const Memory *m, double t, double *u) {
#if INTERMEDIATE
  ask(owner(m), t, false);
#endif
  if (!m->moving) return m->v + IU;
  const double dt = t - m->v[0], half = 0.5 * dt * dt;
  for (int i = 0; i < NU; i++) u[i] = m->v[IU + i] + dt * m->slope[i] + half * m->curve[i];
  return u;
}

static void derivatives(const Memory *m, double t, const double *x, double *xdot) {
  double u[NU + 1];
  f_derivatives(&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP, m->k, xdot);
}

/* Derivatives at the begin of a solver's step: those that were fetched there, if nothing has changed. */
static void first_derivatives(const Memory *m, double t, const double *x, double *xdot) {
  if ((m->stale == FRESH || (COUPLED_RATES && m->stale == COUPLED_DONE)) && t == m->v[0]) memcpy(xdot, m->v + IXD, NX * sizeof *xdot);
  else derivatives(m, t, x, xdot);
}

/* Go to time t with the inputs, not with the states. */
static void move_on(Memory *m, double t) {
#if INTERMEDIATE
  ask(owner(m), t, true);
#endif
  if (m->moving) {
    const double dt = t - m->v[0], half = 0.5 * dt * dt;
    for (int i = 0; i < NU; i++) {
      m->v[IU + i] = m->v[IU + i] + dt * m->slope[i] + half * m->curve[i];
      m->slope[i] += dt * m->curve[i];
    }
  }
  m->v[0] = t;
}

static void refresh(Instance *c) {
  if (c->m.stale) evaluate_outputs(&c->m);
}

/* Bring an output or derivative up to date: outputs such as a state without all the others, and what is
   coupled without the energies. */
static void refresh_for(Instance *c, uint32_t k) {
  Memory *m = &c->m;
  double *v = m->v, none[1];
  (void)v, (void)none;
#if NQ
  if (k >= IY && QUICK[k - IY]) {
    if (m->stale != ALL) return;
    f_quick(v, v + IX, v + IZ, v + IU, v + IP, m->k, v + IY);
    m->stale = QUICK_DONE;
    return;
  }
#endif
#if COUPLED
  if (k >= IY && ASKED[k - IY]) {
    if (m->stale == COUPLED_DONE) return;
    f_coupled(v, v + IX, v + IZ, v + IU, v + IP, m->k, RATES(v, none), v + IY);
    m->stale = COUPLED_DONE;
    return;
  }
#endif
  refresh(c);
}

static int check_finite(Instance *c, int from, int count) {
  for (int i = from; i < from + count; i++)
    if (!isfinite(c->m.v[i]))
      return report(c, ERROR, "%s: variable %s is not finite (%g) at time %.9g s", MODEL, NAMES[i],
                    c->m.v[i], c->m.v[0]);
  return OK;
}

/* -- start, reset, get, set -------------------------------------------------------------------- */

static void set_start(Instance *c) {
  memset(&c->m, 0, sizeof c->m);
  memcpy(c->m.v, START, sizeof c->m.v);
  c->m.stop = INFINITY;
  c->m.mode = INSTANTIATED;
  c->m.stale = ALL;
  f_constants(c->m.v + IP, c->m.k);
}

static Instance *instantiate(const char *name, const char *token, int version, int model_exchange,
                             int logging, void *environment) {
  Instance *c = calloc(1, sizeof *c);
  if (!c) return 0;
  c->version = version;
  c->first = version == 3;
  c->model_exchange = model_exchange;
  c->logging = logging;
  c->environment = environment;
  c->name = malloc(strlen(name ? name : "") + 1);
  if (!c->name) {
    free(c);
    return 0;
  }
  strcpy(c->name, name ? name : "");
  set_start(c);
  (void)token;
  return c;
}

static void release(Instance *c) {
  if (c) free(c->name);
  free(c);
}

static int get_values(Instance *c, const uint32_t vr[], size_t n, double values[]) {
#if INTERMEDIATE
  if (n && c->m.mode == UPDATING) return only_in(c, 0, "getting a value");
#endif
  double *const v = c->m.v;
  const uint32_t first = c->first;
  for (size_t i = 0; i < n;) {
    const uint32_t k = vr[i] - first;
    if (k >= METHOD && (k >= NV || k == METHOD))
      return report(c, ERROR, "%s: value reference %u is no real variable", MODEL, vr[i]);
    if (c->m.stale && k >= IXD && k < IP && !(k >= IU && k < IY)) refresh_for(c, k);
    values[i++] = v[k];
    if (!(fabs(v[k]) <= DBL_MAX)) return check_finite(c, k, 1);
    if (c->m.stale == ALL) continue;
    const char *const known = c->m.stale == QUICK_DONE ? QUICK : ASKED;
    for (; i < n; i++) { /* the hot path, in one pass: outputs that are as fresh */
      const uint32_t y = vr[i] - first - IY;
      if (y >= NY || (c->m.stale && !known[y]) || !(fabs(v[IY + y]) <= DBL_MAX)) break;
      values[i] = v[IY + y];
    }
  }
  return OK;
}

static int set_value(Instance *c, uint32_t k, double value) {
  double *v = c->m.v;
  if (k >= NV)
    return report(c, ERROR, "%s: there is no variable with value reference %u", MODEL, k + c->first);
  if (!isfinite(value))
    return report(c, ERROR, "%s: variable %s cannot be set to %g at time %.9g s: not finite", MODEL,
                  NAMES[k], value, v[0]);
  int parameter = (k >= IP && k < IZ) || k >= IS;
  int state = (k >= IX && k < IXD) || (k >= IZ && k < IS);
  if (!parameter && !state && !(k >= IU && k < IY))
    return report(c, ERROR, "%s: variable %s is calculated and cannot be set", MODEL, NAMES[k]);
  if (state && c->m.mode > INITIALIZING)
    return report(c, ERROR, "%s: state %s can only be set before the end of initialization (time %.9g s)",
                  MODEL, NAMES[k], v[0]);
  if (parameter) {
#if INTERMEDIATE
    if (c->m.mode == UPDATING) return only_in(c, 0, "setting a parameter");
#endif
    if (c->m.mode == CONTINUOUS)
      return report(c, ERROR, "%s: parameter %s can be set in event mode, not in continuous-time mode", MODEL,
                    NAMES[k]);
    if (FIXED[k] && c->m.mode > INITIALIZING)
      return report(c, ERROR, "%s: fixed parameter %s can only be set before the end of initialization",
                    MODEL, NAMES[k]);
    if (value < MINIMUM[k] || value > MAXIMUM[k])
      return report(c, ERROR, "%s: parameter %s = %g is outside [%g, %g]", MODEL, NAMES[k], value,
                    MINIMUM[k], MAXIMUM[k]);
  }
  v[k] = value;
  c->m.stale = ALL;
  return OK;
}

/* Any variables, with what hangs on parameters only. */
static int set_any(Instance *c, const uint32_t vr[], size_t n, const double values[]) {
  int parameters = 0, status = OK;
  for (size_t i = 0; i < n && status == OK; i++) {
    const uint32_t k = vr[i] - c->first;
    if (k == METHOD) status = report(c, ERROR, "%s: value reference %u is no real variable", MODEL, vr[i]);
    else status = set_value(c, k, values[i]);
    if (status == OK && k >= IU && k < IY) c->m.slope[k - IU] = c->m.curve[k - IU] = 0;
    parameters |= k >= IP && k < IZ;
  }
  if (parameters) f_constants(c->m.v + IP, c->m.k);
  return status;
}

static int set_values(Instance *c, const uint32_t vr[], size_t n, const double values[]) {
  Memory *const m = &c->m;
  double *const v = m->v;
  if (n && m->mode >= TERMINATED) return only_in(c, 0, "setting a value");
  const uint32_t first = c->first + IU;
  const int moving = m->moving;
  int changed = 0;
  size_t i = 0;
  /* the hot path, in one pass: inputs, from now on held */
  for (; i < n; i++) {
    const uint32_t k = vr[i] - first;
    const double value = values[i];
    if (k >= NU || !(fabs(value) <= DBL_MAX)) break;
    changed |= v[IU + k] != value;
    v[IU + k] = value;
    if (moving) m->slope[k] = m->curve[k] = 0;
  }
  if (changed && !UPDATED(c)) m->stale = ALL;
  return i < n ? set_any(c, vr + i, n - i, values + i) : OK;
}

/* Derivatives of inputs, which move with them until they are set again. */
static int set_input_derivatives(Instance *c, const uint32_t vr[], size_t n, const int order[], const double values[]) {
  Memory *m = &c->m;
  const unsigned modes = IN(INITIALIZING) | IN(STEPPING);
  if (n && only_in(c, modes, "setting derivatives of inputs") != OK) return ERROR;
  for (size_t i = 0; i < n; i++) {
    const uint32_t k = vr[i] - IU;
    if (k >= NU) return report(c, ERROR, "%s: value reference %u is no input with derivatives", MODEL, vr[i]);
    if (order[i] < 1 || order[i] > 2)
      return report(c, ERROR, "%s: derivative of order %d of input %s; must be 1 or 2", MODEL, order[i], NAMES[vr[i]]);
    if (!(fabs(values[i]) <= DBL_MAX))
      return report(c, ERROR, "%s: a derivative of input %s cannot be set to %g at time %.9g s: not finite", MODEL,
                    NAMES[vr[i]], values[i], m->v[0]);
    (order[i] == 1 ? m->slope : m->curve)[k] = values[i];
    m->moving = 1;
  }
  return OK;
}

/* -- saved states --------------------------------------------------------------------------------- */

static int save_state(Instance *c, void **state) {
#if INTERMEDIATE
  if (c->m.mode == UPDATING) return only_in(c, 0, "saving a state");
#endif
  if (!state) return report(c, ERROR, "%s: no place given for the state", MODEL);
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return report(c, ERROR, "%s: out of memory", MODEL);
  memcpy(*state, &c->m, sizeof(Memory));
  return OK;
}

enum { TOKEN_BYTES = 16 };

static int serialize(Instance *c, const void *state, uint8_t bytes[], size_t size) {
  if (!state || !bytes) return report(c, ERROR, "%s: no state given", MODEL);
  if (size < TOKEN_BYTES + sizeof(Memory))
    return report(c, ERROR, "%s: %zu bytes are too few for a state", MODEL, size);
  memcpy(bytes, TOKEN, TOKEN_BYTES);
  memcpy(bytes + TOKEN_BYTES, state, sizeof(Memory));
  return OK;
}

static int deserialize(Instance *c, const uint8_t bytes[], size_t size, void **state) {
  if (!state) return report(c, ERROR, "%s: no place given for the state", MODEL);
  if (!bytes || size != TOKEN_BYTES + sizeof(Memory) || memcmp(bytes, TOKEN, TOKEN_BYTES))
    return report(c, ERROR, "%s: these %zu bytes are not a state of this FMU", MODEL, size);
  if (!*state) *state = malloc(sizeof(Memory));
  if (!*state) return report(c, ERROR, "%s: out of memory", MODEL);
  memcpy(*state, bytes + TOKEN_BYTES, sizeof(Memory));
  return OK;
}
