/* One FMU instance: variables, sample clocks, solvers. Included by all.c after the generated
   model.c, which defines the sizes NX NU NY NP NZ NC, the tables and the CasADi functions.

   All variables stand in one array v of doubles; the value reference of a variable is its index:
   [time, x, xdot, u, y, p, z, solver.method, solver.step, solver.tolerance].
   Everything that a saved state must hold is in Memory, a plain struct. */

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
enum { INSTANTIATED, INITIALIZING, EVENT, CONTINUOUS, STEPPING, TERMINATED, FAILED };
enum { OK, WARNING, DISCARD, ERROR, FATAL };

typedef struct {
  double v[NV];
  double period[NC + 1]; /* of each sample clock; depends on fixed parameters only */
  double tick[NC + 1];   /* index of the next tick of each clock */
  double next[NC + 1];   /* its time */
  double stop;           /* where the importer says that the simulation ends */
  double h;              /* last accepted step of an error-controlled solver, 0: none yet */
  double j[NJ + 1];      /* Jacobian that is kept, and the factors of its matrix for the step hw */
  double w[NLU + 1];
  double hw;
  double slope[NU + 1];  /* first derivatives of the inputs at the present time */
  double curve[NU + 1];  /* second derivatives */
  int32_t mode;
  int32_t stale;         /* outputs and derivatives must be evaluated again */
  int32_t moving;        /* inputs have been given derivatives */
  int32_t left;          /* for how many steps the Jacobian may still serve */
} Memory;

typedef struct {
  Memory m;
  int model_exchange;
  int version;
  int logging;
  char *name;
  void *environment;
  void (*log2)(void *, const char *, int, const char *, const char *, ...);
  void (*log3)(void *, int, const char *, const char *);
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
                                         "in continuous-time mode", "in step mode", "terminated",
                                         "stopped by a failed step"};
#define IN(mode) (1u << (mode))

/* Refuse a call in a mode in which the standards do not allow it. */
static int only_in(Instance *c, unsigned modes, const char *call) {
  if (modes & IN(c->m.mode)) return OK;
  return report(c, ERROR, "%s: %s is not allowed while the FMU is %s", MODEL, call, MODE_NAMES[c->m.mode]);
}

/* -- model functions ------------------------------------------------------------------------ */

static void evaluate_outputs(double *v) {
  const double *arg[] = {v, v + IX, v + IZ, v + IU, v + IP};
  double *res[] = {v + IXD, v + IY};
  f_outputs(arg, res, 0, 0, 0);
}

/* Inputs at time t: held, or u + u' dt + u'' dt^2/2 from the present time on. */
static const double *inputs_at(const Memory *m, double t, double *u) {
  if (!m->moving) return m->v + IU;
  const double dt = t - m->v[0], half = 0.5 * dt * dt;
  for (int i = 0; i < NU; i++) u[i] = m->v[IU + i] + dt * m->slope[i] + half * m->curve[i];
  return u;
}

static void derivatives(const Memory *m, double t, const double *x, double *xdot) {
  double u[NU + 1];
  const double *arg[] = {&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP};
  double *res[] = {xdot};
  f_derivatives(arg, res, 0, 0, 0);
}

/* Derivatives at the begin of a solver's step: those that were fetched there, if nothing has changed. */
static void first_derivatives(const Memory *m, double t, const double *x, double *xdot) {
  if (!m->stale && t == m->v[0]) memcpy(xdot, m->v + IXD, NX * sizeof *xdot);
  else derivatives(m, t, x, xdot);
}

/* Go to time t with the inputs, not with the states. */
static void move_on(Memory *m, double t) {
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
  if (c->m.stale) {
    evaluate_outputs(c->m.v);
    c->m.stale = 0;
  }
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
  c->m.stale = 1;
}

static Instance *instantiate(const char *name, const char *token, int version, int model_exchange,
                             int logging, void *environment) {
  Instance *c = calloc(1, sizeof *c);
  if (!c) return 0;
  c->version = version;
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
  for (size_t i = 0; i < n; i++) {
    uint32_t k = vr[i];
    if (k >= NV || k == METHOD) return report(c, ERROR, "%s: value reference %u is no real variable", MODEL, k);
    if (c->m.stale && k >= IXD && k < IP && !(k >= IU && k < IY)) refresh(c);
    values[i] = c->m.v[k];
    if (!isfinite(values[i])) return check_finite(c, k, 1);
  }
  return OK;
}

static int set_value(Instance *c, uint32_t k, double value) {
  double *v = c->m.v;
  if (k >= NV) return report(c, ERROR, "%s: there is no variable with value reference %u", MODEL, k);
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
  c->m.stale = 1;
  return OK;
}

static int set_values(Instance *c, const uint32_t vr[], size_t n, const double values[]) {
  double *v = c->m.v;
  if (n && c->m.mode >= TERMINATED) return only_in(c, 0, "setting a value");
  for (size_t i = 0; i < n; i++) {
    uint32_t k = vr[i];
    if (k >= IU && k < IY && isfinite(values[i])) { /* the hot path: an input, from now on held */
      if (v[k] != values[i]) c->m.stale = 1;
      v[k] = values[i];
      c->m.slope[k - IU] = c->m.curve[k - IU] = 0;
      continue;
    }
    if (k == METHOD) return report(c, ERROR, "%s: value reference %u is no real variable", MODEL, k);
    int status = set_value(c, k, values[i]);
    if (status != OK) return status;
  }
  return OK;
}

/* Derivatives of inputs, which move with them until they are set again. */
static int set_input_derivatives(Instance *c, const uint32_t vr[], size_t n, const int order[], const double values[]) {
  Memory *m = &c->m;
  const unsigned modes = IN(INITIALIZING) | IN(STEPPING);
  if (n && only_in(c, modes, "setting derivatives of inputs") != OK) return ERROR;
  for (size_t i = 0; i < n; i++) {
    const uint32_t k = vr[i];
    if (k < IU || k >= IY) return report(c, ERROR, "%s: value reference %u is no input with derivatives", MODEL, k);
    if (order[i] < 1 || order[i] > 2)
      return report(c, ERROR, "%s: derivative of order %d of input %s; must be 1 or 2", MODEL, order[i], NAMES[k]);
    if (!isfinite(values[i]))
      return report(c, ERROR, "%s: a derivative of input %s cannot be set to %g at time %.9g s: not finite", MODEL,
                    NAMES[k], values[i], m->v[0]);
    (order[i] == 1 ? m->slope : m->curve)[k - IU] = values[i];
    m->moving = 1;
  }
  return OK;
}

/* -- sample clocks ----------------------------------------------------------------------------- */

/* Ticks lie at k*T. One within 1e-7 T of the end of a step belongs to the next step, at whose beginning
   it is due, so that rounding of k*H and k*T cannot split one instant into two. */
#define SLACK 1e-7

static int start_clocks(Instance *c) {
#if NC
  Memory *m = &c->m;
  const double *arg[] = {m->v + IP};
  double *res[] = {m->period};
  f_periods(arg, res, 0, 0, 0);
  for (int k = 0; k < NC; k++) {
    if (!(m->period[k] > 0))
      return report(c, ERROR, "%s: sample clock %d has period %g s; it must be positive", MODEL, k, m->period[k]);
    m->tick[k] = ceil(m->v[0] / m->period[k] - SLACK);
    m->next[k] = m->tick[k] * m->period[k];
  }
#else
  (void)c;
#endif
  return OK;
}

/* Execute the clocks that are due at the present time, in order of declaration. */
static void run_ticks(Instance *c) {
#if NC
  Memory *m = &c->m;
  double *v = m->v, z[NZ + 1];
  for (int k = 0; k < NC; k++) {
    if (!(m->next[k] <= v[0] + SLACK * m->period[k])) continue;
    const double *arg[] = {v, v + IX, v + IZ, v + IU, v + IP};
    double *res[] = {z};
    UPDATES[k](arg, res, 0, 0, 0);
    memcpy(v + IZ, z, NZ * sizeof *z);
    m->tick[k] += 1;
    m->next[k] = m->tick[k] * m->period[k];
    m->stale = 1;
  }
#else
  (void)c;
#endif
}

/* Time of the first tick that lies clearly before `end`, else `end`. */
static double next_tick(const Instance *c, double end) {
  double first = end;
  for (int k = 0; k < NC; k++)
    if (c->m.next[k] < end - SLACK * c->m.period[k] && c->m.next[k] < first) first = c->m.next[k];
  return first;
}

/* -- solvers ----------------------------------------------------------------------------------- */

#if NX
/* Classical Runge-Kutta, order 4. */
static void rk4(const Memory *m, double t, double h, double *x) {
  double k1[NX], k2[NX], k3[NX], k4[NX], y[NX];
  first_derivatives(m, t, x, k1);
  for (int i = 0; i < NX; i++) y[i] = x[i] + 0.5 * h * k1[i];
  derivatives(m, t + 0.5 * h, y, k2);
  for (int i = 0; i < NX; i++) y[i] = x[i] + 0.5 * h * k2[i];
  derivatives(m, t + 0.5 * h, y, k3);
  for (int i = 0; i < NX; i++) y[i] = x[i] + h * k3[i];
  derivatives(m, t + h, y, k4);
  for (int i = 0; i < NX; i++) x[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
}

/* Rodas3: linearly implicit, 4 stages, order 3(2), L-stable; Sandu et al., Atmos. Environ. 31 (1997).
   e receives the difference to the embedded solution of order 2. */
static void rodas3(const Memory *m, double t, double h, double *x, double *e) {
  double f[NX], ft[NX], j[NJ + 1], w[NLU + 1], k1[NX], k2[NX], k3[NX], k4[NX], y[NX], u[NU + 1];
  const double *arg[] = {&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP};
  double *res[] = {f, j, ft};
  const double ih = 1.0 / h;
  f_jacobian(arg, res, 0, 0, 0);
  if (m->moving) { /* what the inputs add to df/dt, by a difference along their derivatives */
    const double dt = t - m->v[0];
    for (int i = 0; i < NU; i++) u[i] += h * (m->slope[i] + dt * m->curve[i]);
    double *moved[] = {y};
    f_derivatives(arg, moved, 0, 0, 0);
    for (int i = 0; i < NX; i++) ft[i] += (y[i] - f[i]) * ih;
  }
  f_factor(j, 2.0 * ih, w);
  for (int i = 0; i < NX; i++) k1[i] = f[i] + 0.5 * h * ft[i];
  f_solve(w, k1);
  for (int i = 0; i < NX; i++) k2[i] = f[i] + 4.0 * ih * k1[i] + 1.5 * h * ft[i];
  f_solve(w, k2);
  for (int i = 0; i < NX; i++) y[i] = x[i] + 2.0 * k1[i];
  derivatives(m, t + h, y, f);
  for (int i = 0; i < NX; i++) k3[i] = f[i] + ih * (k1[i] - k2[i]);
  f_solve(w, k3);
  for (int i = 0; i < NX; i++) y[i] = y[i] + k3[i];
  derivatives(m, t + h, y, f);
  for (int i = 0; i < NX; i++) k4[i] = f[i] + ih * (k1[i] - k2[i] - (8.0 / 3.0) * k3[i]);
  f_solve(w, k4);
  for (int i = 0; i < NX; i++) {
    x[i] = y[i] + k4[i];
    e[i] = k4[i];
  }
}

/* Dormand-Prince, order 5(4). */
static void dopri5(const Memory *m, double t, double h, double *x, double *e) {
  double k1[NX], k2[NX], k3[NX], k4[NX], k5[NX], k6[NX], k7[NX], y[NX];
  first_derivatives(m, t, x, k1);
  for (int i = 0; i < NX; i++) y[i] = x[i] + h * (1.0 / 5.0 * k1[i]);
  derivatives(m, t + 1.0 / 5.0 * h, y, k2);
  for (int i = 0; i < NX; i++) y[i] = x[i] + h * (3.0 / 40.0 * k1[i] + 9.0 / 40.0 * k2[i]);
  derivatives(m, t + 3.0 / 10.0 * h, y, k3);
  for (int i = 0; i < NX; i++)
    y[i] = x[i] + h * (44.0 / 45.0 * k1[i] - 56.0 / 15.0 * k2[i] + 32.0 / 9.0 * k3[i]);
  derivatives(m, t + 4.0 / 5.0 * h, y, k4);
  for (int i = 0; i < NX; i++)
    y[i] = x[i] + h * (19372.0 / 6561.0 * k1[i] - 25360.0 / 2187.0 * k2[i] +
                       64448.0 / 6561.0 * k3[i] - 212.0 / 729.0 * k4[i]);
  derivatives(m, t + 8.0 / 9.0 * h, y, k5);
  for (int i = 0; i < NX; i++)
    y[i] = x[i] + h * (9017.0 / 3168.0 * k1[i] - 355.0 / 33.0 * k2[i] + 46732.0 / 5247.0 * k3[i] +
                       49.0 / 176.0 * k4[i] - 5103.0 / 18656.0 * k5[i]);
  derivatives(m, t + h, y, k6);
  for (int i = 0; i < NX; i++)
    x[i] = x[i] + h * (35.0 / 384.0 * k1[i] + 500.0 / 1113.0 * k3[i] + 125.0 / 192.0 * k4[i] -
                       2187.0 / 6784.0 * k5[i] + 11.0 / 84.0 * k6[i]);
  derivatives(m, t + h, x, k7);
  for (int i = 0; i < NX; i++)
    e[i] = h * (71.0 / 57600.0 * k1[i] - 71.0 / 16695.0 * k3[i] + 71.0 / 1920.0 * k4[i] -
                17253.0 / 339200.0 * k5[i] + 22.0 / 525.0 * k6[i] - 1.0 / 40.0 * k7[i]);
}

/* ROS34PW2: linearly implicit W-method, 4 stages, order 3(2) whatever the matrix, L-stable with the
   true Jacobian; Rang and Angermann, BIT 45 (2005). The Jacobian is an old one, f is taken at the
   stages' own times. e receives the difference to the embedded solution of order 2. */
enum { KEEP = 20 }; /* steps with one Jacobian */
#define GAMMA 0.435866521508459

static void rosw3(Memory *m, double t, double h, double *x, double *e) {
  double k1[NX], k2[NX], k3[NX], k4[NX], y[NX];
  const double ih = 1.0 / h;
  if (m->left == 0) {
    double u[NU + 1], ft[NX];
    const double *arg[] = {&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP};
    double *res[] = {k1, m->j, ft};
    f_jacobian(arg, res, 0, 0, 0);
    m->left = KEEP;
    m->hw = 0;
  }
  if (!(fabs(h - m->hw) <= 1e-9 * h)) {
    f_factor(m->j, ih / GAMMA, m->w);
    m->hw = h;
  }
  first_derivatives(m, t, x, k1);
  f_solve(m->w, k1);
  for (int i = 0; i < NX; i++) y[i] = x[i] + 2.0 * k1[i];
  derivatives(m, t + 0.871733043016918 * h, y, k2);
  for (int i = 0; i < NX; i++) k2[i] = k2[i] - ih * (4.588560720558084 * k1[i]);
  f_solve(m->w, k2);
  for (int i = 0; i < NX; i++) y[i] = x[i] + (1.4192173174557652 * k1[i] - 0.2592322116729698 * k2[i]);
  derivatives(m, t + 0.7315799577888524 * h, y, k3);
  for (int i = 0; i < NX; i++) k3[i] = k3[i] - ih * (4.184760482319161 * k1[i] - 0.285192017355496 * k2[i]);
  f_solve(m->w, k3);
  for (int i = 0; i < NX; i++)
    y[i] = x[i] + (4.184760482319161 * k1[i] - 0.285192017355496 * k2[i] + 2.2942803602790423 * k3[i]);
  derivatives(m, t + h, y, k4);
  for (int i = 0; i < NX; i++)
    k4[i] = k4[i] - ih * (6.36817920012836 * k1[i] + 6.795620944466837 * k2[i] - 2.870098604331055 * k3[i]);
  f_solve(m->w, k4);
  for (int i = 0; i < NX; i++) {
    x[i] = y[i] + k4[i];
    e[i] = 0.27774994764797034 * k1[i] - 1.4032398951759986 * k2[i] + 1.7726301276675511 * k3[i] + 0.5 * k4[i];
  }
  m->left -= 1;
}

/* Error-controlled integration from the present time to t1; steps are at most solver.step long. */
static int adaptive(Instance *c, double t1) {
  double *v = c->m.v, x[NX], e[NX], t = v[0];
  const int implicit = v[METHOD] != DOPRI5, kept = v[METHOD] == ROSW3_ADAPTIVE;
  double h = c->m.h > 0 ? c->m.h : 0.1 * v[STEP];
  const double exponent = implicit ? -1.0 / 3.0 : -1.0 / 5.0;
  while (t < t1) {
    if (h > v[STEP]) h = v[STEP];
    const int last = t + h * (1 + 1e-9) >= t1;
    const double hs = last ? t1 - t : h;
    memcpy(x, v + IX, sizeof x);
    if (kept) rosw3(&c->m, t, hs, x, e);
    else if (implicit) rodas3(&c->m, t, hs, x, e);
    else dopri5(&c->m, t, hs, x, e);
    double error = 0;
    for (int i = 0; i < NX; i++) {
      if (OWNER[i] && v[OWNER[i]] == 0) continue; /* state of an effect that is absent */
      const double scale = v[TOLERANCE] * (NOMINAL[i] + fabs(v[IX + i]));
      const double ratio = fabs(e[i]) / scale;
      if (!(ratio <= error)) error = ratio; /* a NaN ends up here too */
    }
    if (error <= 1) {
      memcpy(v + IX, x, sizeof x);
      t = last ? t1 : t + hs;
    } else if (kept && c->m.left < KEEP - 1) {
      c->m.left = 0; /* perhaps the Jacobian was too old: once more with a new one */
      continue;
    }
    double factor = isfinite(error) ? 0.9 * pow(error + 1e-10, exponent) : 0.1;
    if (factor > 5) factor = 5;
    if (factor < 0.1) factor = 0.1;
    if (!last || error > 1) h = hs * factor;
    else if (hs * factor > h) h = hs * factor;
    if (h < 1e-12 * (1 + fabs(t)))
      return report(c, ERROR, "%s: the solver's step fell to %g s at time %.9g s; loosen solver.tolerance "
                    "or use the fixed-step method", MODEL, h, t);
  }
  c->m.h = h;
  return OK;
}
#endif

/* Bring the states from the present time to t1; the time stays if that fails. */
static int integrate(Instance *c, double t1) {
  double *v = c->m.v;
  const double t0 = v[0];
#if NX
  if (v[METHOD] == RK4 || v[METHOD] == RODAS3) {
    const double count = ceil((t1 - t0) / v[STEP] * (1 - 1e-9));
    if (!(count < 1e9))
      return report(c, ERROR, "%s: %g s with solver.step %g s are too many steps", MODEL, t1 - t0, v[STEP]);
    const int n = count < 1 ? 1 : (int)count;
    const double h = (t1 - t0) / n;
    double e[NX];
    for (int i = 0; i < n; i++) {
      const double t = t0 + i * h;
      if (v[METHOD] == RK4) rk4(&c->m, t, h, v + IX);
      else rodas3(&c->m, t, h, v + IX, e);
    }
  } else {
    const int status = adaptive(c, t1);
    if (status != OK) return status;
  }
#endif
  move_on(&c->m, t1);
  c->m.stale = 1;
  const int status = check_finite(c, IX, NX);
  if (status != OK) v[0] = t0;
  return status;
}

static int do_step(Instance *c, double t, double h) {
  double *v = c->m.v;
  if (c->m.mode != STEPPING)
    return report(c, ERROR, "%s: doStep at %.9g s, but the FMU %s", MODEL, t,
                  c->m.mode < EVENT ? "is not initialized" : c->m.mode == FAILED ? "has failed before"
                  : c->m.mode == TERMINATED ? "is terminated" : "is not in step mode");
  const double t1 = t + h;
  if (!(t1 > t) || !isfinite(t1))
    return report(c, ERROR, "%s: communication step %g s at time %.9g s", MODEL, h, t);
  if (!(fabs(t - v[0]) <= 1e-9 * (1 + fabs(t))))
    return report(c, ERROR, "%s: doStep starts at %.9g s but the FMU is at %.9g s", MODEL, t, v[0]);
  if (t1 > c->m.stop + 1e-9 * (1 + fabs(c->m.stop)))
    return report(c, ERROR, "%s: doStep from %.9g s to %.9g s goes past the stop time %.9g s", MODEL, t, t1,
                  c->m.stop);
  if (TIMED && v[0] != t) c->m.stale = 1; /* by a rounding */
  v[0] = t;
  double next;
  do {
    run_ticks(c);
    next = next_tick(c, t1);
    int status = integrate(c, next);
    if (status == OK) status = check_finite(c, IZ, NZ);
    if (status != OK) {
      c->m.mode = FAILED;
      return status;
    }
  } while (next < t1);
  return OK;
}

/* -- modes --------------------------------------------------------------------------------------- */

static int enter_initialization(Instance *c) {
  const int status = only_in(c, IN(INSTANTIATED), "entering initialization mode");
  if (status == OK) c->m.mode = INITIALIZING;
  return status;
}

static int terminate(Instance *c) {
  const unsigned initialized = IN(EVENT) | IN(CONTINUOUS) | IN(STEPPING) | IN(FAILED);
  const int status = only_in(c, initialized, "terminating");
  if (status == OK) c->m.mode = TERMINATED;
  return status;
}

/* Model exchange only: co-simulation is in step mode once it is initialized. */
static int change_mode(Instance *c, int from, int to, const char *call) {
  const int status = only_in(c, IN(from), call);
  if (status == OK) c->m.mode = to;
  return status;
}

static int set_time(Instance *c, double time) {
  const int status = only_in(c, IN(EVENT) | IN(CONTINUOUS), "setting the time");
  if (status != OK) return status;
  if (!isfinite(time)) return report(c, ERROR, "%s: time cannot be set to %g: not finite", MODEL, time);
  c->m.v[0] = time;
  c->m.stale = 1;
  return OK;
}

/* Messages of both categories are always given; only their names are checked. */
static int set_logging(Instance *c, int on, size_t n, const char *const categories[]) {
  for (size_t i = 0; i < n; i++)
    if (!categories[i] || (strcmp(categories[i], "logStatusError") && strcmp(categories[i], "logStatusDiscard")))
      return report(c, ERROR, "%s: there is no log category %s; there are logStatusError and logStatusDiscard",
                    MODEL, categories[i] ? categories[i] : "(null)");
  c->logging = on;
  return OK;
}

static int leave_initialization(Instance *c) {
  if (c->m.mode != INITIALIZING) return report(c, ERROR, "%s: initialization mode was not entered", MODEL);
  int status = start_clocks(c);
  if (status != OK) return status;
  evaluate_outputs(c->m.v);
  c->m.stale = 0;
  status = check_finite(c, IXD, NX);
  if (status == OK) status = check_finite(c, IY, NY);
  if (status != OK) return status;
  c->m.mode = c->model_exchange ? EVENT : STEPPING;
  return OK;
}

static int directional(Instance *c, const uint32_t unknowns[], size_t nu, const uint32_t knowns[], size_t nk,
                       const double seed[], double result[]) {
  double s[NV] = {0}, dxdot[NX + 1], dy[NY + 1];
  double *v = c->m.v;
  for (size_t i = 0; i < nk; i++) {
    uint32_t k = knowns[i];
    if (k >= NV || (k >= IXD && k < IU) || (k >= IY && k < IP) || k >= IS)
      return report(c, ERROR, "%s: no directional derivative with respect to value reference %u", MODEL, k);
    s[k] = seed[i];
  }
  const double *arg[] = {v, v + IX, v + IZ, v + IU, v + IP, s, s + IX, s + IZ, s + IU, s + IP};
  double *res[] = {dxdot, dy};
  f_directional(arg, res, 0, 0, 0);
  for (size_t i = 0; i < nu; i++) {
    uint32_t k = unknowns[i];
    if (k >= IXD && k < IU) result[i] = dxdot[k - IXD];
    else if (k >= IY && k < IP) result[i] = dy[k - IY];
    else return report(c, ERROR, "%s: no directional derivative of value reference %u", MODEL, k);
    if (!isfinite(result[i]))
      return report(c, ERROR, "%s: directional derivative of %s is not finite (%g) at time %.9g s", MODEL, NAMES[k],
                    result[i], v[0]);
  }
  return OK;
}

/* -- saved states --------------------------------------------------------------------------------- */

static int save_state(Instance *c, void **state) {
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
