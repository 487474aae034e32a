/* The whole FMU as one translation unit: nothing but the FMI functions and cosim_work is visible outside. */
#include "trigonometry.c"

#include "model.c"

#include "core.c"

#include "solvers.c"

#include "steps.c"

#include "fmi2.c"

#include "fmi3.c"
