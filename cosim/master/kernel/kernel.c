/* Executes a plan (see cosim/master/plan.py) in compiled code, bit for bit like the executor in Python.

   Nothing but arrays of numbers and addresses of FMU functions comes in; no Python object is touched,
   so the caller may release the interpreter lock and run several systems in threads. Compiled
   without fused multiply-add, because the Python executor rounds every product. */

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#include <fenv.h>
#include <float.h>
#include <string.h>

#include "run.h"

/* Whether a number is whole up to rounding, and fits: see cosim/fmu/values.py. */
#define ROUNDING 1e-9
#define MISSED 1e-9 /* as in cosim/fmu/intermediate.py */
#define SAME 1e-9   /* as in cosim/fmu/fmi3.py */
#define WHOLE(v) (fabs((v) - rint(v)) <= 1e-9 + 4.0 * DBL_EPSILON * fabs(v))
#define SIGNED(bits, v) (WHOLE(v) && rint(v) >= -ldexp(1.0, bits - 1) && rint(v) < ldexp(1.0, bits - 1))
#define UNSIGNED(bits, v) (WHOLE(v) && rint(v) >= 0.0 && rint(v) < ldexp(1.0, bits))
#define TRUTH(v) (WHOLE(v) && (rint(v) == 0.0 || rint(v) == 1.0))

#define CONVERT(code, ctype, fits, rounded)                                          \
  case code:                                                                         \
    for (size_t i = 0; i < c->n_values; i++) {                                       \
      double *const v = values + c->slots[i];                                        \
      if (!into) *v = (double)((ctype *)c->buffer)[i];                               \
      else if (fits) ((ctype *)c->buffer)[i] = (ctype)(rounded);                     \
      else return UNFIT;                                                             \
    }                                                                                \
    break;

/* Move numbers between the run's values and the buffer of a call. */
static int convert(const Call *c, double *values, int into) {
  switch (c->type) {
    CONVERT(0, double, true, *v)
    CONVERT(1, float, !(fabs(*v) > FLT_MAX), *v)
    CONVERT(2, int8_t, SIGNED(8, *v), rint(*v))
    CONVERT(3, uint8_t, UNSIGNED(8, *v), rint(*v))
    CONVERT(4, int16_t, SIGNED(16, *v), rint(*v))
    CONVERT(5, uint16_t, UNSIGNED(16, *v), rint(*v))
    CONVERT(6, int32_t, SIGNED(32, *v), rint(*v))
    CONVERT(7, uint32_t, UNSIGNED(32, *v), rint(*v))
    CONVERT(8, int64_t, SIGNED(64, *v), rint(*v)) /* enumerations of FMI 3 */
    CONVERT(9, bool, TRUTH(*v), rint(*v))
    CONVERT(10, int32_t, TRUTH(*v), rint(*v)) /* booleans of FMI 2 */
    CONVERT(11, float, (double)(float)*v == *v || isnan(*v), *v) /* given integers */
  }
  return 0;
}

static inline int access_call(const Call *c) {
  if (c->version == 2)
    return ((Access2)c->function)(c->component, c->references, c->n_references, c->buffer);
  return ((Access3)c->function)(c->component, c->references, c->n_references, c->buffer, c->n_values);
}

/* Calls whose buffers are part of the run's values; the first that failed, or null. */
static Call *call2(Run *run, Call *c, const Call *end, int *status) {
  for (; c < end; c++) {
    run->at = c;
    *status = ((Access2)c->function)(c->component, c->references, c->n_references, c->buffer);
    if (!*status) continue;
    if (FAILED(*status)) return c;
    c->warned = 1;
  }
  return 0;
}

static Call *call3(Run *run, Call *c, const Call *end, int *status) {
  for (; c < end; c++) {
    run->at = c;
    *status = ((Access3)c->function)(c->component, c->references, c->n_references, c->buffer, c->n_values);
    if (!*status) continue;
    if (FAILED(*status)) return c;
    c->warned = 1;
  }
  return 0;
}

static Call *call_converted(Run *run, Call *c, const Call *end, int set, int *status) {
  double *const values = run->values;
  for (; c < end; c++) {
    if (set && c->slots && (*status = convert(c, values, 1))) return c;
    run->at = c;
    *status = access_call(c);
    if (FAILED(*status)) return c;
    c->warned |= *status;
    if (!set && c->slots) convert(c, values, 0);
  }
  return 0;
}

/* A step that does not miss the end of the run by rounding, and never goes beyond. */
static inline double bounded(const Run *run, double t, double h) {
  if (t < run->bounded) return h;
  if (t + h > run->end - ROUNDING * h)
    for (h = run->end - t; t + h > run->end;) h = nextafter(h, 0.0);
  return h;
}

/* Rounding and treatment of tiny numbers, which a step must leave as they are for the other FMUs. */
#if defined(__x86_64__)
#define MODES() ((unsigned)__builtin_ia32_stmxcsr() & ~0x3fu) /* without the flags of exceptions */
static void undo_modes(Member *m, unsigned wanted) {
  if (fegetround() != FE_TONEAREST) fesetround(FE_TONEAREST);
  __builtin_ia32_ldmxcsr(wanted);
  m->modes = 1;
}
#else
#define MODES() 0u
static void undo_modes(Member *m, unsigned wanted) {}
#endif

/* Inlined with `watched` known: reading the modes waits for all arithmetic under way, 7 ns a member, and
   members that are known to leave them alone are spared it. */
static inline Member *step2(Run *run, Member *m, const Member *end, double t, double h, int watched, int *status) {
  const unsigned modes = watched ? MODES() : 0;
  for (; m < end; m++) {
    run->at = m;
    *status = ((Step2)m->step)(m->component, t, h, run->final);
    if (watched && MODES() != modes) undo_modes(m, modes);
    if (!*status) continue;
    if (FAILED(*status)) return m;
    m->warned = 1;
  }
  return 0;
}

/* An FMU of FMI 3 asks for inputs within its step: see cosim/fmu/intermediate.py. */
EXPORT void cosim_update(void *environment, double time, bool requested, bool allowed, bool finished, bool can,
                         bool *early, double *when) {
  Update *const u = environment;
  if (early) *early = false;
  if (when) *when = time;
  if (!u) return;
  const double missed = MISSED * (1.0 + fabs(u->end));
  if (time < u->finished - missed) u->back = time;
  if (finished) u->finished = time;
  if (!requested || u->status || time == u->last) return;
  if (!(u->begin - missed <= time && time <= u->end + missed)) {
    u->status = OUTSIDE;
    u->wrong = time;
    return;
  }
  u->last = time;
  const double dt = time - u->begin, half = 0.5 * dt * dt;
  for (Group *g = u->groups; g < u->groups + u->n_groups; g++) {
    int status = 0;
    for (size_t i = 0; i < g->n_values; i++) {
      const int64_t k = g->first + (int64_t)i, m = u->means[k];
      const double moved = u->values[u->slots[k]] + dt * (m < 0 ? 0.0 : u->slope[m]) + half * (m < 0 ? 0.0 : u->curve[m]);
      if (!g->single) ((double *)g->buffer)[i] = moved;
      else if (!(fabs(moved) > FLT_MAX)) ((float *)g->buffer)[i] = (float)moved;
      else status = UNFIT;
    }
    if (!status) status = ((Access3)g->function)(u->component, g->references, g->n_references, g->buffer, g->n_values);
    if (status == 1) g->warned = 1;
    else if (status) {
      u->status = status;
      u->wrong = time;
      u->failed = g - u->groups;
      return;
    }
  }
}

static inline Member *step3(Run *run, Member *m, const Member *end, double t, double h, int watched, int *status) {
  bool event = false, stop = false, early = false;
  const unsigned modes = watched ? MODES() : 0;
  for (; m < end; m++) {
    Update *const u = m->update;
    run->at = m;
    if (u) u->begin = u->last = u->finished = t, u->end = t + h;
    *status = ((Step3)m->step)(m->component, t, h, run->final, &event, &stop, &early, &m->reached);
    if (watched && MODES() != modes) undo_modes(m, modes);
    if (u && u->status && *status != FATAL) *status = REFUSED;
    if (!*status && !stop && !early) continue;
    if (!FAILED(*status) && (stop || (early && m->reached < t + h - SAME * h))) *status = stop ? TERMINATED : EARLY;
    if (FAILED(*status)) return m;
    if (*status) m->warned = 1;
  }
  return 0;
}

/* Keep observed values if it is their turn; note outputs for the energy of bonds. */
static int record(Run *run) {
  const double *values = run->values;
  const int turn = run->index == run->next_record;
  if (run->sparse && !turn && (run->carried || !run->n_terms)) return 0; /* nobody looks at it */
  if (!run->carried || run->index == 0)
    for (int64_t i = 0; i < run->n_terms; i++) run->terms[i].previous = values[run->terms[i].output];
  double *const row = run->rows + run->row * run->n_record;
  const Copy *c = run->records, *const end = c + run->n_record;
  /* between its turns a row is written, but not counted: it is the last one if the run ends here */
  for (double *to = row; c < end; c++) *to++ = values[c->source] * c->gain + c->offset;
  if (!turn) return 0;
  run->next_record += run->every;
  for (const double *v = row; v < row + run->n_record; v++)
    if (!isfinite(*v)) return NOT_FINITE;
  run->row++;
  return 0;
}

static void copy_plain(const Copy *c, const Copy *end, double *values) {
  /* adding zero turns -0 into 0, as the factor 1 and the offset 0 of the general copy do */
  for (; c < end; c++) values[c->target] = values[c->source] + 0.0;
}

static void copy_scaled(const Copy *c, const Copy *end, double *values) {
  for (; c < end; c++) values[c->target] = values[c->source] * c->gain + c->offset;
}

/* Inlined with `held` known: it is no question of every term then. */
static inline void add_energy(Run *run, int held) {
  const double *const values = run->values;
  const double half = 0.5 * run->step;
  Term *const end = run->terms + run->n_terms;
  for (Term *t = run->terms; t < end;) {
    const int64_t bond = t->bond;
    double energy = run->bond_energy[bond], turnover = run->bond_turnover[bond];
    do {
      const double output = values[t->output], mean = t->previous + output;
      const double part = t->sign * (held ? t->held : values[t->input]) * mean * half;
      energy += part;
      turnover += 0.5 * fabs(part);
      t->previous = output;
      t++;
    } while (t < end && t->bond == bond);
    run->bond_energy[bond] = energy;
    run->bond_turnover[bond] = turnover;
  }
}

#include "extrapolation.c"

static const Derivatives *set_derivatives(Run *run, const Derivatives *r, const Derivatives *end, int *status) {
  for (; r < end; r++) {
    run->at = r;
    *status = ((SetDerivatives2)r->function)(r->component, r->references, r->n, r->orders, r->values);
    if (FAILED(*status)) return r;
  }
  return 0;
}

static Member *substep(Run *run, Member *m, int64_t code, int *status) {
  const double parts = (double)(code / PARTS / 4), part = (double)(code / 4 % PARTS);
  const double t = run->times[run->index] + part * run->step / parts, h = bounded(run, t, run->step / parts);
  return code % 2 ? step3(run, m, m + 1, t, h, code & 2, status) : step2(run, m, m + 1, t, h, code & 2, status);
}

#include "newton.c"

/* Instructions from first to before last; 0 or the status that ended them.

   Each operation jumps to the next one by itself: so the processor foretells each jump from where it
   is, and operations that cannot fail ask for no status. */
static int execute(Run *run, int64_t first, int64_t last) {
  static const void *const operations[] = {
    [EXTERNAL] = &&external, [RECORD] = &&recorded, [COPY] = &&copy, [SCALE] = &&scale, [CALL2] = &&called2,
    [CALL3] = &&called3, [CONVERT_SET] = &&converted, [CONVERT_GET] = &&converted, [STEP2] = &&stepped2,
    [STEP3] = &&stepped3, [ENERGY] = &&energy, [SOLVE] = &&solved, [NOTE] = &&note,
    [EXTRAPOLATE] = &&extrapolated, [SUBSTEP] = &&substepped, [HOLD] = &&hold,
    [SET_DERIVATIVES] = &&derivatives, [WATCHED2] = &&watched2, [WATCHED3] = &&watched3,
    [MOVE] = &&moved, [UNSEEN] = &&unseen,
  };
  const Instruction *in = run->instructions + first, *const end = run->instructions + last;
  Call *const calls = run->calls, *call = 0;
  Member *const members = run->members, *member = 0;
  const double now = run->now, size = run->size;
  const Derivatives *refused = 0;
  int status = 0;
#define GO if (in < end) goto *operations[in->operation]; else return 0
#define NEXT in++; GO
#define UNLESS(failed) if (failed) goto stopped; NEXT
  GO;
external:
  for (int64_t i = 0; i < run->n_external; i++)
    run->values[run->external_slot[i]] = run->external[run->index * run->n_external + i];
  NEXT;
recorded:
  status = record(run);
  UNLESS(status);
copy:
  copy_plain(run->copies + in->first, run->copies + in->last, run->values);
  NEXT;
scale:
  copy_scaled(run->copies + in->first, run->copies + in->last, run->values);
  NEXT;
called2:
  call = call2(run, calls + in->first, calls + in->last, &status);
  UNLESS(call);
called3:
  call = call3(run, calls + in->first, calls + in->last, &status);
  UNLESS(call);
converted:
  call = call_converted(run, calls + in->first, calls + in->last, in->operation == CONVERT_SET, &status);
  UNLESS(call);
stepped2:
  member = step2(run, members + in->first, members + in->last, now, size, 0, &status);
  UNLESS(member);
stepped3:
  member = step3(run, members + in->first, members + in->last, now, size, 0, &status);
  UNLESS(member);
watched2:
  member = step2(run, members + in->first, members + in->last, now, size, 1, &status);
  UNLESS(member);
watched3:
  member = step3(run, members + in->first, members + in->last, now, size, 1, &status);
  UNLESS(member);
energy:
  if (in->first == 1) add_energy(run, 1);
  else add_energy(run, 0);
  NEXT;
solved:
  if (FAILED(status = solve(run, run->loops + in->first)))
    return status; /* the instruction inside has said what failed */
  NEXT;
note:
  memmove(run->history + run->n_means, run->history, 3 * (size_t)run->n_means * sizeof *run->history);
  for (int64_t i = 0; i < run->n_means; i++) run->history[i] = run->values[run->means[i].source];
  NEXT;
hold:
  for (int64_t i = 0; i < run->n_terms; i++) {
    Term *const t = run->terms + i;
    t->held = t->mean >= 0 ? run->average[t->mean] : run->values[t->input];
  }
  NEXT;
extrapolated:
  extrapolate(run, in->first, in->last);
  NEXT;
derivatives:
  refused = set_derivatives(run, run->derivatives + in->first, run->derivatives + in->last, &status);
  UNLESS(refused);
moved:
  move(run, in->first, in->last);
  NEXT;
unseen:
  if (run->index + in->last != run->next_record && run->index + 1 != run->last) in += in->first;
  NEXT;
substepped:
  member = substep(run, members + in->first, in->last, &status);
  UNLESS(member);
stopped:
  run->failed_call = call ? call - calls : -1;
  run->failed_member = member ? member - members : -1;
  run->failed_derivatives = refused ? refused - run->derivatives : -1;
  return status;
#undef GO
#undef NEXT
#undef UNLESS
}

static int advance(Run *run, int64_t last) {
  int status = 0;
  for (; run->index < last; run->index++) {
    run->now = run->times[run->index];
    run->size = bounded(run, run->now, run->step);
    if ((status = execute(run, 0, run->n_instructions))) break;
  }
  run->at = 0;
  return status;
}

/* Communication steps from run->index up to `last`; 0 or the status that ended it. */
EXPORT int cosim_run(Run *run, int64_t last) {
  run->last = last;
  return advance(run, last);
}

/* Instructions from first to before last, with steps of this size from this time on. */
EXPORT int cosim_do(Run *run, int64_t first, int64_t last, double time, double size) {
  run->now = time;
  run->size = size;
  const int status = execute(run, first, last);
  run->at = 0;
  return status;
}

/* Each member keeps its present state, returns to the one that it keeps, or forgets it. */
EXPORT int cosim_states(Run *run, int what) {
  for (int64_t i = 0; i < run->n_members; i++) {
    Member *const m = run->members + i;
    int status = 0;
    run->at = m;
    if (what == RESTORE) status = ((SetState)m->set_state)(m->component, m->state);
    else if (m->state) status = ((KeepState)m->free_state)(m->component, &m->state);
    if (what == SAVE && !FAILED(status)) {
      m->state = 0;
      status = ((KeepState)m->get_state)(m->component, &m->state);
    }
    if (FAILED(status)) {
      run->failed_member = i;
      return status;
    }
    if (status) m->warned = 1;
  }
  run->at = 0;
  return 0;
}

/* Steps that the solvers of all members have made so far, as far as they count them. */
static double work_of(const Run *run) {
  double sum = 0.0;
  for (int64_t i = 0; i < run->n_members; i++) {
    const Member *m = &run->members[i];
    if (m->work) sum += (double)((Work)m->work)(m->component);
  }
  return sum;
}

/* The same within so many steps of solvers, a communication step of a member counting as one, too, and as
   long as no recorded value is larger than `most`. */
EXPORT int cosim_run_within(Run *run, int64_t last, double limit, double most) {
  const double begun = work_of(run) + (double)(run->index * run->n_members);
  run->last = last;
  while (run->index < last) {
    const int64_t look = (run->index / LOOK + 1) * LOOK, next = look < last ? look : last;
    const int status = advance(run, next);
    if (status) return status;
    if (work_of(run) + (double)(run->index * run->n_members) - begun > limit) return TOO_LONG;
    if (next % CHECK || !run->row) continue;
    for (int64_t i = (run->row - 1) * run->n_record; i < run->row * run->n_record; i++)
      if (fabs(run->rows[i]) > most) return TOO_LARGE;
  }
  return 0;
}

/* The layout that this library was compiled for, to be compared with the caller's. */
EXPORT int64_t cosim_size(int what) {
  const size_t sizes[] = {sizeof(Run), sizeof(Member), sizeof(Call), sizeof(Instruction), sizeof(Copy), sizeof(Term),
                          sizeof(Loop), sizeof(Mean), sizeof(Derivatives), sizeof(Update), sizeof(Group)};
  return (int64_t)sizes[what];
}
