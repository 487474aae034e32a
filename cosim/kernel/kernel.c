/* Executes a plan (see cosim/plan.py) in compiled code, bit for bit like the executor in Python.

   Nothing but arrays of numbers and addresses of FMU functions comes in; no Python object is touched,
   so the caller may release the interpreter lock and run several systems in threads. Compiled
   without fused multiply-add, because the Python executor rounds every product. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Operations; calls and steps are sorted by FMI version, and by whether numbers are converted. */
enum { EXTERNAL, RECORD, COPY, SCALE, CALL2, CALL3, CONVERT_SET, CONVERT_GET, STEP2, STEP3, ENERGY };
enum { TERMINATED = 5, NOT_FINITE = 6, UNFIT = 7 }; /* beyond the statuses of FMI */

/* One get or set call: n variables of one type of one instance. */
typedef struct {
  void *component;
  void *function;           /* of the FMU */
  const uint32_t *references;
  void *buffer;             /* as the FMU sees the values */
  const int64_t *slots;     /* where they stand in the run's values; null: the buffer is there */
  size_t n_references, n_values;
  int32_t type, version;
} Call;

typedef struct {
  void *component, *step;
} Member;

/* What one operation does: with calls, members, copies from first to before last. */
typedef struct {
  int64_t operation, first, last;
} Instruction;

typedef struct {
  double gain, offset;
  int64_t source, target;
} Copy;

/* Power through one variable of a bond: sign * output of one end * input of the same end. */
typedef struct {
  double sign, previous; /* previous: the output at the beginning of the step */
  int64_t output, input;
  int64_t bond; /* terms of a bond follow each other */
} Term;

typedef struct {
  const Member *members;
  const Call *calls;
  double *values;
  const Instruction *instructions;
  int64_t n_instructions;
  const double *times;
  double step;
  const double *external; /* rows per communication point */
  const int64_t *external_slot;
  int64_t n_external;
  const Copy *copies, *records;
  int64_t n_record, every, row;
  double *rows;
  Term *terms;
  double *bond_energy;
  int64_t n_terms;
  int64_t carried;     /* nothing changes outputs between the end of a step and the next record */
  int64_t index;       /* communication step under way */
  int64_t next_record; /* the next one to be kept */
  int64_t failed_call, failed_member; /* -1: none; neither: a recorded value is not finite */
} Run;

typedef int (*Access2)(void *, const uint32_t *, size_t, void *);
typedef int (*Access3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);

/* Whether a double can be cut to an integer; not-a-number cannot. */
#define ANY(v) (true)
#define SIGNED(bits, v) (trunc(v) >= -ldexp(1.0, bits - 1) && trunc(v) < ldexp(1.0, bits - 1))
#define UNSIGNED(bits, v) (trunc(v) >= 0.0 && trunc(v) < ldexp(1.0, bits))

#define CONVERT(code, ctype, fits)                                                   \
  case code:                                                                         \
    for (size_t i = 0; i < c->n_values; i++) {                                       \
      double *const v = values + c->slots[i];                                        \
      if (!into) *v = (double)((ctype *)c->buffer)[i];                               \
      else if (fits) ((ctype *)c->buffer)[i] = (ctype)*v;                            \
      else return UNFIT;                                                             \
    }                                                                                \
    break;

/* Move numbers between the run's values and the buffer of a call. */
static int convert(const Call *c, double *values, int into) {
  switch (c->type) {
    CONVERT(0, double, ANY(*v))
    CONVERT(1, float, ANY(*v))
    CONVERT(2, int8_t, SIGNED(8, *v))
    CONVERT(3, uint8_t, UNSIGNED(8, *v))
    CONVERT(4, int16_t, SIGNED(16, *v))
    CONVERT(5, uint16_t, UNSIGNED(16, *v))
    CONVERT(6, int32_t, SIGNED(32, *v))
    CONVERT(7, uint32_t, UNSIGNED(32, *v))
    CONVERT(8, int64_t, SIGNED(64, *v))
    CONVERT(9, uint64_t, UNSIGNED(64, *v))
    CONVERT(10, bool, ANY(*v))
  }
  return 0;
}

static inline int access_call(const Call *c) {
  if (c->version == 2)
    return ((Access2)c->function)(c->component, c->references, c->n_references, c->buffer);
  return ((Access3)c->function)(c->component, c->references, c->n_references, c->buffer, c->n_values);
}

/* Calls whose buffers are part of the run's values; the first that failed, or null. */
static const Call *call2(const Call *c, const Call *end, int *status) {
  for (; c < end; c++) {
    *status = ((Access2)c->function)(c->component, c->references, c->n_references, c->buffer);
    if (*status > 1) return c;
  }
  return 0;
}

static const Call *call3(const Call *c, const Call *end, int *status) {
  for (; c < end; c++) {
    *status = ((Access3)c->function)(c->component, c->references, c->n_references, c->buffer, c->n_values);
    if (*status > 1) return c;
  }
  return 0;
}

static const Call *call_converted(const Call *c, const Call *end, double *values, int set, int *status) {
  for (; c < end; c++) {
    if (set && c->slots && (*status = convert(c, values, 1))) return c;
    *status = access_call(c);
    if (*status > 1) return c;
    if (!set && c->slots) convert(c, values, 0);
  }
  return 0;
}

static const Member *step2(const Member *m, const Member *end, double t, double h, int *status) {
  for (; m < end; m++) {
    *status = ((Step2)m->step)(m->component, t, h, 1);
    if (*status > 1) return m;
  }
  return 0;
}

static const Member *step3(const Member *m, const Member *end, double t, double h, int *status) {
  bool event = false, stop = false, early = false;
  double last = 0;
  for (; m < end; m++) {
    *status = ((Step3)m->step)(m->component, t, h, true, &event, &stop, &early, &last);
    if (*status <= 1 && stop) *status = TERMINATED;
    if (*status > 1) return m;
  }
  return 0;
}

/* Keep observed values if it is their turn; note outputs for the energy of bonds. */
static int record(Run *run) {
  const double *values = run->values;
  if (!run->carried || run->index == 0)
    for (int64_t i = 0; i < run->n_terms; i++) run->terms[i].previous = values[run->terms[i].output];
  if (run->index != run->next_record) return 0;
  run->next_record += run->every;
  double *row = run->rows + run->row * run->n_record;
  int finite = 1;
  for (int64_t i = 0; i < run->n_record; i++) {
    const Copy *c = run->records + i;
    row[i] = values[c->source] * c->gain + c->offset;
    finite &= isfinite(row[i]) != 0;
  }
  if (!finite) return NOT_FINITE;
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

static void add_energy(Run *run) {
  const double *const values = run->values;
  const double half = 0.5 * run->step;
  Term *const end = run->terms + run->n_terms;
  for (Term *t = run->terms; t < end;) {
    const int64_t bond = t->bond;
    double energy = run->bond_energy[bond];
    do {
      const double output = values[t->output], mean = t->previous + output;
      energy += t->sign * values[t->input] * mean * half;
      t->previous = output;
      t++;
    } while (t < end && t->bond == bond);
    run->bond_energy[bond] = energy;
  }
}

/* One communication step; 0 or the status that ended it. */
static int execute(Run *run) {
  const Instruction *const end = run->instructions + run->n_instructions;
  const Call *const calls = run->calls, *call = 0;
  const Member *const members = run->members, *member = 0;
  for (const Instruction *in = run->instructions; in < end; in++) {
    int status = 0;
    switch (in->operation) {
    case EXTERNAL:
      for (int64_t i = 0; i < run->n_external; i++)
        run->values[run->external_slot[i]] = run->external[run->index * run->n_external + i];
      break;
    case RECORD:
      status = record(run);
      break;
    case COPY:
      copy_plain(run->copies + in->first, run->copies + in->last, run->values);
      break;
    case SCALE:
      copy_scaled(run->copies + in->first, run->copies + in->last, run->values);
      break;
    case CALL2:
      call = call2(calls + in->first, calls + in->last, &status);
      break;
    case CALL3:
      call = call3(calls + in->first, calls + in->last, &status);
      break;
    case CONVERT_SET:
    case CONVERT_GET:
      call = call_converted(calls + in->first, calls + in->last, run->values, in->operation == CONVERT_SET, &status);
      break;
    case STEP2:
      member = step2(members + in->first, members + in->last, run->times[run->index], run->step, &status);
      break;
    case STEP3:
      member = step3(members + in->first, members + in->last, run->times[run->index], run->step, &status);
      break;
    case ENERGY:
      add_energy(run);
      break;
    }
    if (status > 1) {
      run->failed_call = call ? call - calls : -1;
      run->failed_member = member ? member - members : -1;
      return status;
    }
  }
  return 0;
}

/* Communication steps from run->index up to `last`; 0 or the status that ended it. */
EXPORT int cosim_run(Run *run, int64_t last) {
  for (; run->index < last; run->index++) {
    const int status = execute(run);
    if (status) return status;
  }
  return 0;
}

/* The layout that this library was compiled for, to be compared with the caller's. */
EXPORT int64_t cosim_size(int what) {
  const size_t sizes[] = {sizeof(Run), sizeof(Member), sizeof(Call), sizeof(Instruction), sizeof(Copy), sizeof(Term)};
  return (int64_t)sizes[what];
}
