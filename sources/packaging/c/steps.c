/* -- sample clocks ----------------------------------------------------------------------------- */

/* Ticks lie at k*T. One within 1e-7 T and the rounding of t of the end of a step belongs to the next
   step, at whose beginning it is due, so that rounding of k*H and k*T cannot split one instant into two.
   An importer that uses the event mode of co-simulation (FMI 3) has it executed there, with the inputs of
   that point, as in model exchange. */
#define SLACK 1e-7

static double slack(double period, double t) {
  return (isfinite(period) ? SLACK * period : 0) + 4 * DBL_EPSILON * fabs(t);
}

static int start_clocks(Instance *c) {
#if NC
  Memory *m = &c->m;
  f_periods(m->v + IP, m->k, m->period);
  for (int k = 0; k < NC; k++) {
    if (!(m->period[k] > 0))
      return report(c, ERROR, "%s: sample clock %d has period %g s; it must be positive", MODEL, k, m->period[k]);
    m->tick[k] = ceil((m->v[0] - slack(m->period[k], m->v[0])) / m->period[k]);
    m->next[k] = isfinite(m->period[k]) ? m->tick[k] * m->period[k] : m->v[0]; /* at the start alone */
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
    if (!(m->next[k] <= v[0] + slack(m->period[k], v[0]))) continue;
    UPDATES[k](v, v + IX, v + IZ, v + IU, v + IP, m->k, z);
    const int *const values = UPDATED_VALUES + UPDATED_FROM[k];
    for (int i = 0; i < UPDATED_FROM[k + 1] - UPDATED_FROM[k]; i++) v[IZ + values[i]] = z[i];
    m->tick[k] += 1;
    m->next[k] = m->tick[k] * m->period[k];
    m->stale = ALL;
  }
#else
  (void)c;
#endif
}

/* Whether a clock is due at the present time. */
static int tick_due(const Instance *c) {
  for (int k = 0; k < NC; k++)
    if (c->m.next[k] <= c->m.v[0] + slack(c->m.period[k], c->m.v[0])) return 1;
  return 0;
}

/* Time of the first tick that lies clearly before `end`, else `end`. */
static double next_tick(const Instance *c, double end) {
  double first = end;
  for (int k = 0; k < NC; k++)
    if (c->m.next[k] + slack(c->m.period[k], c->m.next[k]) < end && c->m.next[k] < first) first = c->m.next[k];
  return first;
}

/* -- steps -------------------------------------------------------------------------------------- */

/* Bring the states from the present time over `length` to t1; the time stays if that fails. The length
   is given because t1 minus the present time is not the same number in every step. */
static int integrate(Instance *c, double t1, double length) {
  double *v = c->m.v;
  const double t0 = v[0];
#if NX
  if ((v[METHOD] == RK4 || v[METHOD] == RODAS3) && !stiff(&c->m, fmin(length, v[STEP]))) {
    int n = 1;
    double h = length, e[NX];
    if (length > v[STEP]) {
      const double count = ceil(length / v[STEP] * (1 - 1e-9));
      if (!(count < 1e9))
        return report(c, ERROR, "%s: %g s with solver.step %g s are too many steps", MODEL, length, v[STEP]);
      n = (int)count;
      h = length / n;
    }
    c->work += n;
    for (int i = 0; i < n; i++) {
      const double t = t0 + i * h;
      if (v[METHOD] == RK4) rk4(&c->m, t, h, v + IX);
      else rodas3(&c->m, t, h, v + IX, e);
    }
  } else {
    const int status = adaptive(c, t1, length);
    if (status != OK) return status;
  }
#endif
  move_on(&c->m, t1);
  c->m.stale = ALL;
  const int status = check_finite(c, IX, NX);
  if (status != OK) v[0] = t0;
  return status;
}

/* No function of FMI: steps of solvers that an instance has made in co-simulation, tried ones included. */
EXPORT int64_t cosim_work(const Instance *c) { return c->work; }

static int do_step(Instance *c, double t, double h) {
  double *v = c->m.v;
#if INTERMEDIATE
  if (c->m.mode == UPDATING) return only_in(c, 0, "doStep");
#endif
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
  if (TIMED && v[0] != t) c->m.stale = ALL; /* by a rounding */
  v[0] = t;
#if INTERMEDIATE
  c->asked = t; /* the importer has set the inputs of the begin */
#endif
  double next;
  do {
    run_ticks(c);
    next = next_tick(c, t1);
    int status = integrate(c, next, next == t1 && v[0] == t ? h : next - v[0]);
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

static int change_mode(Instance *c, int from, int to, const char *call) {
  const int status = only_in(c, IN(from), call);
  if (status == OK) c->m.mode = to;
  return status;
}

static int set_time(Instance *c, double time) {
  const int status = only_in(c, IN(EVENT) | IN(CONTINUOUS), "setting the time");
  if (status != OK) return status;
  if (!c->model_exchange) return report(c, ERROR, "%s: the time of co-simulation is set by its steps", MODEL);
  if (!isfinite(time)) return report(c, ERROR, "%s: time cannot be set to %g: not finite", MODEL, time);
  c->m.v[0] = time;
  c->m.stale = ALL;
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
  evaluate_outputs(&c->m);
  status = check_finite(c, IXD, NX);
  if (status == OK) status = check_finite(c, IY, NY);
  if (status != OK) return status;
  c->m.mode = c->model_exchange || c->event_mode ? EVENT : STEPPING;
  return OK;
}

static int directional(Instance *c, const uint32_t unknowns[], size_t nu, const uint32_t knowns[], size_t nk,
                       const double seed[], double result[]) {
  double s[NV] = {0}, dxdot[NX + 1], dy[NY + 1];
  double *v = c->m.v;
  for (size_t i = 0; i < nk; i++) {
    const uint32_t k = knowns[i] - c->first;
    if (k >= NV || (k >= IXD && k < IU) || (k >= IY && k < IP) || k >= IS)
      return report(c, ERROR, "%s: no directional derivative with respect to value reference %u", MODEL,
                    knowns[i]);
    s[k] = seed[i];
  }
  f_directional(v, v + IX, v + IZ, v + IU, v + IP, s, s + IX, s + IZ, s + IU, s + IP, c->m.k, dxdot, dy);
  for (size_t i = 0; i < nu; i++) {
    const uint32_t k = unknowns[i] - c->first;
    if (k >= IXD && k < IU) result[i] = dxdot[k - IXD];
    else if (k >= IY && k < IP) result[i] = dy[k - IY];
    else return report(c, ERROR, "%s: no directional derivative of value reference %u", MODEL, unknowns[i]);
    if (!isfinite(result[i]))
      return report(c, ERROR, "%s: directional derivative of %s is not finite (%g) at time %.9g s", MODEL, NAMES[k],
                    result[i], v[0]);
  }
  return OK;
}
