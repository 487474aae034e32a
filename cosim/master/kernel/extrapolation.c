/* Inputs that follow polynomials through their sources' values; part of kernel.c. */

/* Of the last two second differences the one nearer to 0, and 0 if their signs differ; newest first. */
static double bend(double a, double b, double c, double d) {
  const double last = a - 2.0 * b + c, before = b - 2.0 * c + d;
  const double nearer = fabs(last) < fabs(before) ? last : before; /* no branches: signs are random */
  return last * before > 0.0 ? nearer : 0.0;
}

/* Slope and curve of an input by a parabola through its source, newest value first. */
static inline void parabola(int ahead, double a, double b, double c, double d, double half, double square,
                            double *slope, double *curve) {
  const double second = bend(a, b, c, d), chord = 2.0 * (a - b);
  *slope = (ahead ? chord - second : chord + second) * half;
  *curve = second * square;
}

/* Inputs by the polynomial through the last values of their source: its mean over the step, or
   its value at the begin and its derivatives. */
static void extrapolate(Run *run, int64_t first, int64_t last) {
  const double inverse = 1.0 / run->step, half = 0.5 * inverse, square = inverse * inverse;
  const double *const h0 = run->history, *const h1 = h0 + run->n_means, *const h2 = h1 + run->n_means,
               *const h3 = h2 + run->n_means;
  double *const values = run->values;
  for (int64_t i = first, n; i < last; i += n) {
    const Mean *const m = run->means + i;
    const int64_t known = run->index + *run->past + (m->ahead ? 1 : 0);
    const int64_t most = known < 1 ? 0 : known < 3 ? 1 : 2; /* a parabola looks at four values */
    const int64_t order = m->order < most ? m->order : most;
    n = m->alike < last - i ? m->alike : last - i;
    if (m->bonded || !m->moving)
      for (int64_t j = 0, k = i; j < n; j++, k++) {
        const double now = values[m[j].source];
        double mean;
        if (m->ahead)
          mean = order == 1 ? 0.5 * (now + h0[k]) : 0.5 * (now + h0[k]) - bend(now, h0[k], h1[k], h2[k]) / 12.0;
        else
          mean = order == 0 ? h0[k] : order == 1 ? 1.5 * h0[k] - 0.5 * h1[k]
                 : h0[k] + 0.5 * (h0[k] - h1[k]) + 5.0 * bend(h0[k], h1[k], h2[k], h3[k]) / 12.0;
        run->average[k] = mean * m[j].gain + m[j].offset;
      }
    if (!m->moving) {
      for (int64_t j = 0; j < n; j++) values[m[j].target] = run->average[i + j];
      continue;
    }
    double *const slope = run->slope + i, *const curve = run->curve + i;
    if (order == 2 && m->ahead)
      for (int64_t j = 0, k = i; j < n; j++, k++)
        parabola(1, values[m[j].source], h0[k], h1[k], h2[k], half, square, slope + j, curve + j);
    else if (order == 2)
      for (int64_t j = 0, k = i; j < n; j++, k++)
        parabola(0, h0[k], h1[k], h2[k], h3[k], half, square, slope + j, curve + j);
    else
      for (int64_t j = 0, k = i; j < n; j++, k++) {
        slope[j] = order == 0 ? 0.0 : (m->ahead ? values[m[j].source] - h0[k] : h0[k] - h1[k]) * inverse;
        curve[j] = 0.0;
      }
    for (int64_t j = 0; j < n; j++) {
      values[m[j].target] = h0[i + j] * m[j].gain + m[j].offset;
      slope[j] = slope[j] * m[j].gain;
      curve[j] = curve[j] * m[j].gain;
    }
  }
}

/* An input takes its mean over a part of the step: see cosim/master/extrapolation.py. */
static void move(Run *run, int64_t index, int64_t code) {
  const Mean *m = run->means + index;
  const double width = run->step / (double)(code / PARTS), middle = ((double)(code % PARTS) + 0.5) * width;
  const double begin = run->history[index] * m->gain + m->offset;
  run->values[m->target] =
      begin + middle * run->slope[index] + (0.5 * middle * middle + width * width / 24.0) * run->curve[index];
}
