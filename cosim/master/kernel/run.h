/* What a run is made of, as arrays of numbers and addresses; `__init__.py` has the same structures. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Operations; calls and steps are sorted by FMI version, and by whether numbers are converted. */
enum { EXTERNAL, RECORD, COPY, SCALE, CALL2, CALL3, CONVERT_SET, CONVERT_GET, STEP2, STEP3, ENERGY,
       SOLVE, NOTE, EXTRAPOLATE, SUBSTEP, HOLD, SET_DERIVATIVES, WATCHED2, WATCHED3, MOVE, UNSEEN };
/* beyond the statuses of FMI */
enum { TERMINATED = 1000, NOT_FINITE, UNFIT, UNSETTLED, TOO_LONG, TOO_LARGE, REFUSED, EARLY };
enum { OUTSIDE = 1001 }; /* why an update was refused, beside UNFIT and statuses of FMI */
enum { SAVE, RESTORE, FORGET }; /* what `cosim_states` does */
/* FMI knows 0 (ok), 1 (warning) and more that are errors; what it does not know is one, too. */
#define FAILED(status) ((unsigned)(status) > 1)
enum { FATAL = 4 };
enum { LOOK = 50, CHECK = 100 }; /* as in cosim/master/session.py */
enum { PARTS = 1 << 16 };        /* as in cosim/master/plan.py */

/* One get or set call: n variables of one type of one instance. */
typedef struct {
  void *component;
  void *function;           /* of the FMU */
  const uint32_t *references;
  void *buffer;             /* as the FMU sees the values */
  const int64_t *slots;     /* where they stand in the run's values; null: the buffer is there */
  size_t n_references, n_values;
  int32_t type, version;
  int64_t warned; /* whether the FMU has returned a warning */
} Call;

/* Inputs that move while an FMU of FMI 3 steps: see cosim/fmu/intermediate.py. A group is one set call. */
typedef struct {
  void *function;
  const uint32_t *references;
  void *buffer;
  size_t n_references, n_values;
  int64_t first, single; /* place of the first value; whether they are Float32 */
  int64_t warned;
} Group;

typedef struct {
  void *component;
  double begin, end, last, finished; /* of the step under way; time of the values that are set; finished by the FMU */
  double wrong, back;                /* a time that was refused, or before one that was finished */
  int64_t status, failed;            /* why it was refused, and the group that was */
  const double *values, *slope, *curve; /* at the begin of the step */
  const int64_t *slots, *means;         /* per input where they stand; means < 0: it is held */
  Group *groups;
  int64_t n_groups;
} Update;

typedef struct {
  void *component, *step;
  void *work;     /* function that counts the steps of its solver; null: it has none */
  double reached; /* the time at which an FMU of FMI 3 says that it stands */
  int64_t warned;
  int64_t modes;  /* whether a step has left the rounding of numbers changed; it was undone */
  void *get_state, *set_state, *free_state, *state; /* functions, and the state that is kept */
  Update *update; /* what answers an FMU of FMI 3 that asks for inputs within its step, or null */
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
  double sign, previous, held; /* previous: the output at the beginning of the step */
  int64_t output, input;
  int64_t bond; /* terms of a bond follow each other */
  int64_t mean; /* of the input if it moves within a step, else -1 */
} Term;

/* An algebraic loop, z = G(z), cut at some outputs: see cosim/master/algebraic_loops.py. */
typedef struct {
  const int64_t *sources;    /* slots of z */
  double *inverse;           /* of I - dG/dz */
  int64_t *valid;            /* whether it is good for anything */
  const double *floor;       /* size of each unknown below which errors are not relative */
  double *work;              /* 5 n + 2 n n numbers */
  double tolerance;          /* relative change of z at which it counts as solved */
  double increment;          /* of differences, relative, too */
  int64_t n, first, last;    /* instructions of a sweep */
} Loop;

/* An input that follows a polynomial through its source's values: see cosim/master/plan.py. */
typedef struct {
  double gain, offset;
  int32_t source, target;
  int32_t alike; /* how many from here on are of the same kind and belong to one instance */
  int8_t order, ahead, moving, bonded;
} Mean;

/* One call that tells an FMU derivatives of its inputs: see cosim/master/input_derivatives.py. */
typedef struct {
  void *component, *function;
  const uint32_t *references;
  const int32_t *orders;
  const double *values;
  size_t n;
} Derivatives;

typedef struct {
  Member *members;
  Call *calls;
  double *values;
  const Instruction *instructions;
  int64_t n_instructions, n_members;
  const double *times;
  double now, size; /* of the step under way */
  double step, end, bounded; /* when the run ends; from when on steps may miss that by rounding */
  const double *external; /* rows per communication point */
  const int64_t *external_slot;
  int64_t n_external;
  const Copy *copies, *records;
  int64_t n_record, every, row;
  double *rows;
  Term *terms;
  double *bond_energy, *bond_turnover;
  int64_t n_terms;
  int64_t final;       /* steps are not taken back */
  int64_t carried;     /* nothing changes outputs between the end of a step and the next record */
  int64_t index;       /* communication step under way */
  int64_t next_record; /* the next one to be kept */
  int64_t sparse;      /* nobody looks at what is only recorded but where it is its turn, and at `last` */
  int64_t last;        /* up to where the present call goes */
  const Loop *loops;
  const Mean *means;
  double *history; /* n_means of the sources at the beginning of this step, then of the three before */
  const int64_t *past; /* how many of them there are before the first step */
  int64_t n_means;
  double *average, *slope, *curve; /* per mean: over the step, derivatives at its begin */
  const Derivatives *derivatives;
  const void *volatile at; /* the call under way, member or derivatives; null between calls: who waits for this
                              process can say which FMU it was in when it ended */
  int64_t failed_loop, failed_call, failed_member, failed_derivatives; /* -1: none; none of them: a recorded value is not finite */
} Run;

typedef int (*Access2)(void *, const uint32_t *, size_t, void *);
typedef int (*Access3)(void *, const uint32_t *, size_t, void *, size_t);
typedef int (*SetDerivatives2)(void *, const uint32_t *, size_t, const int32_t *, const double *);
typedef int64_t (*Work)(void *);
typedef int (*KeepState)(void *, void **);
typedef int (*SetState)(void *, void *);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);
