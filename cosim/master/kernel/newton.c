/* Solves algebraic loops by Newton's method, like `Newton` in cosim/master/newton.py.

   A part of kernel.c, which includes it: a sweep around a loop executes instructions, and one of
   the instructions solves a loop. */

enum { ITERATIONS = 60 }; /* these two as in cosim/master/newton.py */
#define CONTRACTION 0.25

static int execute(Run *run, int64_t first, int64_t last);

/* G(z), once around a loop. */
static int sweep(Run *run, const Loop *loop, const double *z, double *value) {
  for (int64_t i = 0; i < loop->n; i++) run->values[loop->sources[i]] = z[i];
  const int status = execute(run, loop->first, loop->last);
  if (FAILED(status)) return status;
  for (int64_t i = 0; i < loop->n; i++) value[i] = run->values[loop->sources[i]];
  return 0;
}

static double larger(double a, double b) { return b > a ? b : a; }

/* Gauss-Jordan elimination with partial pivoting of n rows of 2 n numbers; whether it worked. */
static int invert(double *rows, int64_t n) {
  for (int64_t k = 0; k < n; k++) {
    int64_t best = k;
    for (int64_t i = k + 1; i < n; i++)
      if (fabs(rows[2 * n * i + k]) > fabs(rows[2 * n * best + k])) best = i;
    const double pivot = rows[2 * n * best + k];
    if (!(1e-13 < fabs(pivot) && fabs(pivot) < INFINITY)) return 0;
    for (int64_t j = 0; j < 2 * n; j++) {
      const double other = rows[2 * n * k + j];
      rows[2 * n * k + j] = rows[2 * n * best + j];
      rows[2 * n * best + j] = other;
    }
    for (int64_t j = 0; j < 2 * n; j++) rows[2 * n * k + j] /= pivot;
    for (int64_t i = 0; i < n; i++) {
      const double factor = rows[2 * n * i + k];
      if (i == k || factor == 0.0) continue;
      for (int64_t j = 0; j < 2 * n; j++) rows[2 * n * i + j] -= factor * rows[2 * n * k + j];
    }
  }
  return 1;
}

/* The inverse of I - dG/dz by differences around z, where G(z) = value. */
static int difference(Run *run, const Loop *loop, const double *z, const double *value, double *moved, double *there,
                      double *rows) {
  const int64_t n = loop->n;
  for (int64_t j = 0; j < n; j++) {
    const double increment = loop->increment * larger(loop->floor[j], fabs(z[j]));
    for (int64_t i = 0; i < n; i++) moved[i] = z[i];
    moved[j] += increment;
    const int status = sweep(run, loop, moved, there);
    if (FAILED(status)) return status;
    for (int64_t i = 0; i < n; i++) {
      rows[2 * n * i + j] = (i == j ? 1.0 : 0.0) - (there[i] - value[i]) / increment;
      rows[2 * n * i + n + j] = i == j ? 1.0 : 0.0;
    }
  }
  *loop->valid = invert(rows, n);
  if (!*loop->valid) return UNSETTLED;
  for (int64_t i = 0; i < n; i++)
    for (int64_t j = 0; j < n; j++) loop->inverse[n * i + j] = rows[2 * n * i + n + j];
  return 0;
}

/* The change of z for a rest G(z) - z, and its relative size. */
static double newton_step(const Loop *loop, const double *z, const double *value, double *change) {
  double size = 0.0;
  for (int64_t i = 0; i < loop->n; i++) {
    double total = 0.0;
    for (int64_t j = 0; j < loop->n; j++) total += loop->inverse[loop->n * i + j] * (value[j] - z[j]);
    change[i] = total;
    const double relative = fabs(total) / larger(loop->floor[i], fabs(z[i]));
    if (!(relative <= size)) size = relative;
  }
  return size;
}

/* Newton's method with a Jacobian that is kept as long as it contracts. */
static int solve(Run *run, const Loop *loop) {
  const int64_t n = loop->n;
  double *const z = loop->work, *const value = z + n, *const change = value + n, *const moved = change + n;
  double *const there = moved + n, *const rows = there + n;
  double last = 0.0;
  run->failed_loop = loop - run->loops;
  for (int64_t i = 0; i < n; i++) z[i] = run->values[loop->sources[i]];
  for (int iteration = 0; iteration < ITERATIONS; iteration++) {
    int status = sweep(run, loop, z, value);
    if (FAILED(status)) return status;
    const int renewed = !*loop->valid;
    if (renewed && (status = difference(run, loop, z, value, moved, there, rows)) > 1) return status;
    double size = newton_step(loop, z, value, change);
    if (size <= loop->tolerance && !renewed) {
      for (int64_t i = 0; i < n; i++) run->values[loop->sources[i]] = z[i];
      return 0;
    }
    if (!renewed && last > 0.0 && !(size <= CONTRACTION * last)) {
      if ((status = difference(run, loop, z, value, moved, there, rows)) > 1) return status;
      size = newton_step(loop, z, value, change);
    }
    if (!(size < INFINITY)) break;
    for (int64_t i = 0; i < n; i++) z[i] += change[i];
    last = size;
  }
  *loop->valid = 0;
  return UNSETTLED;
}
