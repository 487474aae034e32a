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
   Factors are kept as long as Jacobian and step stay the same, bit for bit. e receives the
   difference to the embedded solution of order 2. */
static void rodas3(Memory *m, double t, double h, double *x, double *e) {
  double f[NX], ft[NX], j[NJ + 1], k1[NX], k2[NX], k3[NX], k4[NX], y[NX], u[NU + 1];
  const double ih = 1.0 / h;
  f_jacobian(&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP, m->k, f, j, ft);
#if INTERMEDIATE
  if (owner(m)->required) { /* what the inputs add to df/dt, by the parabola through three of their values */
    double now[NU + 1], half[NU + 1];
    memcpy(now, m->v + IU, NU * sizeof *now);
    memcpy(half, inputs_at(m, t + 0.5 * h, u), NU * sizeof *half);
    const double *const end = inputs_at(m, t + h, u);
    for (int i = 0; i < NU; i++) u[i] = now[i] + (4.0 * (half[i] - now[i]) - (end[i] - now[i]));
    f_derivatives(&t, x, m->v + IZ, u, m->v + IP, m->k, y);
    for (int i = 0; i < NX; i++) ft[i] += (y[i] - f[i]) * ih;
  }
#endif
  if (m->moving) { /* what the inputs add to df/dt, by a difference along their derivatives */
    const double dt = t - m->v[0];
    for (int i = 0; i < NU; i++) u[i] += h * (m->slope[i] + dt * m->curve[i]);
    f_derivatives(&t, x, m->v + IZ, u, m->v + IP, m->k, y);
    for (int i = 0; i < NX; i++) ft[i] += (y[i] - f[i]) * ih;
  }
  if (m->hw != -h || memcmp(j, m->j, NJ * sizeof *j)) {
    memcpy(m->j, j, NJ * sizeof *j);
    f_factor(j, 2.0 * ih, m->w);
    m->hw = -h;
    m->left = 0;
  }
  const double *const w = m->w;
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
    f_jacobian(&t, x, m->v + IZ, inputs_at(m, t, u), m->v + IP, m->k, k1, m->j, ft);
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

/* By how much a step may grow or shrink at once, what part of the best step is taken, and the errors
   with which the next step grows by the most and not at all. */
#define GROW 5.0
#define SHRINK 0.1
#define SAFETY 0.9
/* A solver that tries more steps than this over one stretch, or so many for each solver.step of it, gets
   nowhere: forces have become so large, or change so steeply, that it would take minutes or for ever. */
#define TRIALS 2e5
#define TRIALS_PER_STEP 1e3
/* [s]: no dynamics of a machine are faster; and a few of the numbers that there are around t. */
#define SHORTEST 1e-12
#define CUBE(a) ((a) * (a) * (a))
#define FIFTH(a) ((a) * (a) * (a) * (a) * (a))

/* Steps of a time constant that Runge-Kutta follows to 3e-4 of a jump; at a 2.8th of a step it runs away. */
#define FOLLOWED 2.0

/* Whether an effect is present whose state may be faster than this fixed step: Runge-Kutta's settles at points
   at which the equations do not rest, Rodas3's runs away where its input jumps. */
static int stiff(const Memory *m, double step) {
  for (int i = 0; i < NLAGS; i++)
    if (m->v[LAGS[i]] > 0 && m->v[LAGS[i]] < FOLLOWED * step) return 1;
  for (int i = 0; i < NSTIFF; i++)
    if (m->v[STIFF[i]] != 0) return 1;
  return 0;
}

/* Error-controlled integration over `length` to t1; steps are at most solver.step long. In place of a method
   of fixed step it is Rodas3. */
static int adaptive(Instance *c, double t1, double length) {
  double *v = c->m.v, x[NX], e[NX], t = v[0];
  const int implicit = v[METHOD] != DOPRI5, kept = v[METHOD] == ROSW3_ADAPTIVE;
  double h = c->m.h > 0 ? c->m.h : 0.1 * v[STEP];
  const double exponent = implicit ? -1.0 / 3.0 : -1.0 / 5.0;
  const double quiet = implicit ? CUBE(SAFETY / GROW) : FIFTH(SAFETY / GROW);
  const double steady = implicit ? CUBE(SAFETY) : FIFTH(SAFETY);
  double left = TRIALS + TRIALS_PER_STEP * length / v[STEP];
  while (t < t1) {
    c->work += 1;
    if (!(left-- > 0))
      return report(c, ERROR, "%s: %g solver steps from %.9g s on have only reached %.9g s; loosen "
                    "solver.tolerance or use a fixed-step method", MODEL,
                    floor(TRIALS + TRIALS_PER_STEP * length / v[STEP]), v[0], t);
    if (h > v[STEP]) h = v[STEP];
    const int last = t + h * (1 + 1e-9) >= t1;
    const double hs = !last ? h : t == v[0] ? length : t1 - t;
    memcpy(x, v + IX, sizeof x);
    if (kept) rosw3(&c->m, t, hs, x, e);
    else if (implicit) rodas3(&c->m, t, hs, x, e);
    else dopri5(&c->m, t, hs, x, e);
    double error = quiet;
    for (int i = 0; i < NX; i++) {
      if (OWNER[i] && v[OWNER[i]] == 0) continue; /* state of an effect that is absent */
      const double scale = v[TOLERANCE] * (NOMINAL[i] + fabs(v[IX + i]));
      if (!(fabs(e[i]) <= error * scale)) error = fabs(e[i]) / scale;
      if (isnan(error)) break;
    }
    if (error <= 1) {
      memcpy(v + IX, x, sizeof x);
      t = last ? t1 : t + hs;
      if (error <= steady && h >= v[STEP]) continue; /* it cannot grow */
    } else if (kept && c->m.left < KEEP - 1) {
      c->m.left = 0; /* perhaps the Jacobian was too old: once more with a new one */
      continue;
    }
    double factor = error <= quiet ? GROW : isfinite(error) ? SAFETY * pow(error, exponent) : SHRINK;
    if (factor > GROW) factor = GROW;
    if (factor < SHRINK) factor = SHRINK;
    if (!last || error > 1) h = hs * factor;
    else if (hs * factor > h) h = hs * factor;
    if (h < SHORTEST + 4 * DBL_EPSILON * fabs(t))
      return report(c, ERROR, "%s: the solver's step fell to %g s at time %.9g s; loosen solver.tolerance "
                    "or use the fixed-step method", MODEL, h, t);
  }
  c->m.h = h;
  return OK;
}
#endif
