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

enum { EXTERNAL, RECORD, COPY, SET, STEP, GET, ENERGY };

/* One get or set call: n variables of one type of one instance. */
typedef struct {
  void *get, *set;          /* functions of the FMU */
  const uint32_t *references;
  void *buffer;             /* as the FMU sees the values */
  const int64_t *slots;     /* where they stand in the run's values; null: the buffer is there */
  int64_t n_references, n_values;
  int32_t type, version;
} Call;

typedef struct {
  void *component, *step;
  int64_t first_output, last_output, first_input, last_input; /* calls */
  int32_t version, stopped;
} Member;

typedef struct {
  Member *members;
  Call *calls;
  double *values;
  const int64_t *operations; /* rows (operation, a, b) */
  int64_t n_operations;
  const double *times;
  double step;
  const double *external; /* rows per communication point */
  const int64_t *external_slot;
  int64_t n_external;
  const int64_t *copy_source, *copy_target;
  const double *copy_gain, *copy_offset;
  const int64_t *record_source;
  const double *record_gain, *record_offset;
  int64_t n_record, every, row;
  double *rows;
  const int64_t *bond_index, *bond_output, *bond_input;
  const double *bond_sign;
  double *bond_previous, *bond_energy;
  int64_t n_bond_terms;
  int64_t index;                     /* communication step under way */
  int64_t failed_operation, failed_call, failed_status; /* what went wrong */
} Run;

typedef int (*Access2)(void *, const uint32_t *, size_t, void *);
typedef int (*Access3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);

#define CONVERT(code, ctype)                                                          \
  case code:                                                                          \
    if (into) for (int64_t i = 0; i < c->n_values; i++) ((ctype *)c->buffer)[i] = (ctype)values[c->slots[i]]; \
    else for (int64_t i = 0; i < c->n_values; i++) values[c->slots[i]] = (double)((ctype *)c->buffer)[i];     \
    break;

/* Move numbers between the run's values and the buffer of a call. */
static void convert(const Call *c, double *values, int into) {
  switch (c->type) {
    CONVERT(0, double)
    CONVERT(1, float)
    CONVERT(2, int8_t)
    CONVERT(3, uint8_t)
    CONVERT(4, int16_t)
    CONVERT(5, uint16_t)
    CONVERT(6, int32_t)
    CONVERT(7, uint32_t)
    CONVERT(8, int64_t)
    CONVERT(9, uint64_t)
    CONVERT(10, bool)
  }
}

static int access_call(void *component, const Call *c, void *function) {
  if (c->version == 2) return ((Access2)function)(component, c->references, (size_t)c->n_references, c->buffer);
  return ((Access3)function)(component, c->references, (size_t)c->n_references, c->buffer, (size_t)c->n_values);
}

static int set_inputs(Run *run, const Member *m) {
  for (int64_t k = m->first_input; k < m->last_input; k++) {
    const Call *c = &run->calls[k];
    if (c->slots) convert(c, run->values, 1);
    const int status = access_call(m->component, c, c->set);
    if (status > 1) {
      run->failed_call = k;
      return status;
    }
  }
  return 0;
}

static int get_outputs(Run *run, const Member *m) {
  for (int64_t k = m->first_output; k < m->last_output; k++) {
    const Call *c = &run->calls[k];
    const int status = access_call(m->component, c, c->get);
    if (status > 1) {
      run->failed_call = k;
      return status;
    }
    if (c->slots) convert(c, run->values, 0);
  }
  return 0;
}

static int step_member(Run *run, Member *m) {
  const double t = run->times[run->index];
  if (m->version == 2) return ((Step2)m->step)(m->component, t, run->step, 1);
  bool event = false, stop = false, early = false;
  double last = 0;
  const int status = ((Step3)m->step)(m->component, t, run->step, true, &event, &stop, &early, &last);
  if (stop) m->stopped = 1;
  return status > 1 ? status : stop ? 5 : status;
}

/* Keep observed values if it is their turn; note outputs for the energy of bonds. */
static int record(Run *run) {
  const double *values = run->values;
  for (int64_t i = 0; i < run->n_bond_terms; i++) run->bond_previous[i] = values[run->bond_output[i]];
  if (run->index % run->every) return 0;
  double *row = run->rows + run->row * run->n_record;
  int finite = 1;
  for (int64_t i = 0; i < run->n_record; i++) {
    row[i] = values[run->record_source[i]] * run->record_gain[i] + run->record_offset[i];
    finite &= isfinite(row[i]) != 0;
  }
  if (!finite) return 6;
  run->row++;
  return 0;
}

/* Execute operations of one communication step; 0 or the status that ended it. */
static int execute(Run *run) {
  double *values = run->values;
  for (int64_t k = 0; k < run->n_operations; k++) {
    const int64_t *operation = run->operations + 3 * k, a = operation[1], b = operation[2];
    int status = 0;
    switch (operation[0]) {
    case EXTERNAL:
      for (int64_t i = 0; i < run->n_external; i++)
        values[run->external_slot[i]] = run->external[run->index * run->n_external + i];
      break;
    case RECORD:
      status = record(run);
      break;
    case COPY:
      for (int64_t i = a; i < b; i++)
        values[run->copy_target[i]] = values[run->copy_source[i]] * run->copy_gain[i] + run->copy_offset[i];
      break;
    case SET:
      status = set_inputs(run, &run->members[a]);
      break;
    case STEP:
      status = step_member(run, &run->members[a]);
      break;
    case GET:
      status = get_outputs(run, &run->members[a]);
      break;
    case ENERGY:
      for (int64_t i = 0; i < run->n_bond_terms; i++) {
        const double mean = run->bond_previous[i] + values[run->bond_output[i]];
        run->bond_energy[run->bond_index[i]] +=
            run->bond_sign[i] * values[run->bond_input[i]] * mean * (0.5 * run->step);
      }
      break;
    }
    if (status > 1) {
      run->failed_operation = k;
      run->failed_status = status;
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
  return what == 0 ? (int64_t)sizeof(Run) : what == 1 ? (int64_t)sizeof(Member) : (int64_t)sizeof(Call);
}
