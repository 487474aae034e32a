/* Sine and cosine with the same bits on every machine, both for the price of one.

   The C library's differ from system to system in their last bit, and cost two calls. Reduction to
   +-pi/4 after Cody and Waite in three parts (33 + 33 + 53 bits of pi/2, whose products with up to
   2^20 are exact), polynomials of fdlibm (Sun Microsystems, 1993, k_sin.c and k_cos.c): within 1.1
   units in the last place. Arguments beyond 1.6e6 rad, and what is not finite, go to the C library.

   Two angles are taken at a time, in the two halves of a register, where the compiler can do that; each
   half is computed as if it were alone. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
typedef double Angles __attribute__((vector_size(16)));
typedef uint64_t Bits __attribute__((vector_size(16)));
enum { TOGETHER = 2 };
#else
typedef double Angles;
typedef uint64_t Bits;
enum { TOGETHER = 1 };
#endif
#define FAR 1.6e6

static inline Bits bits_of(Angles numbers) {
  Bits bits;
  memcpy(&bits, &numbers, sizeof bits);
  return bits;
}

static inline Angles numbers_of(Bits bits) {
  Angles numbers;
  memcpy(&numbers, &bits, sizeof numbers);
  return numbers;
}

static inline void near_sines_cosines(Angles x, Angles *sine, Angles *cosine) {
  const Angles whole = x * 6.36619772367581382433e-01 + 6755399441055744.0; /* 1.5 * 2^52 rounds to whole numbers */
  const Angles n = whole - 6755399441055744.0;
  const Angles a = x - n * 1.57079632673412561417e+00, b = n * 6.07710050630396597660e-11, r = a - b;
  const Angles c = n * 2.02226624879595063154e-21 - ((a - r) - b);
  const Angles y = r - c, rest = (r - y) - c;
  const Angles z = y * y, w = z * z, half = 0.5 * z, one = 1.0 - half, v = z * y;
  const Angles odd = 8.33333333332248946124e-03 +
                     z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                     z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
  const Angles even = z * (4.16666666666666019037e-02 +
                           z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05)) +
                      w * w * (-2.75573143513906633035e-07 +
                               z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
  const Angles s = y - ((z * (0.5 * rest - v * odd) - rest) - v * -1.66666666666666324348e-01);
  const Angles q = one + (((1.0 - one) - half) + (z * even - y * rest));
  const Bits quadrant = bits_of(whole), first = bits_of(s), second = bits_of(q);
  const Bits swap = (first ^ second) & (0 - (quadrant & 1));
  *sine = numbers_of(first ^ swap ^ ((quadrant & 2) << 62));
  *cosine = numbers_of(second ^ swap ^ (((quadrant + 1) & 2) << 62));
}

static inline void sine_cosine(double x, double *sine, double *cosine) {
  if (!(fabs(x) < FAR)) {
    *sine = sin(x);
    *cosine = cos(x);
    return;
  }
  Angles s, c;
#if defined(__GNUC__)
  near_sines_cosines((Angles){x, x}, &s, &c);
#else
  near_sines_cosines(x, &s, &c);
#endif
  memcpy(sine, &s, sizeof *sine);
  memcpy(cosine, &c, sizeof *cosine);
}

/* Of several angles at once, a multiple of TOGETHER (see BATCH in c_code.py). */
static void sines_cosines(int n, const double *x, double *sine, double *cosine) {
  int far = 0;
  for (int i = 0; i < n; i++) far |= !(fabs(x[i]) < FAR);
  if (far) {
    for (int i = 0; i < n; i++) sine_cosine(x[i], sine + i, cosine + i);
    return;
  }
  for (int i = 0; i < n; i += TOGETHER) {
    Angles angles, s, c;
    memcpy(&angles, x + i, sizeof angles);
    near_sines_cosines(angles, &s, &c);
    memcpy(sine + i, &s, sizeof s);
    memcpy(cosine + i, &c, sizeof c);
  }
}
