/* Steps one FMU library without any importer and prints its outputs, exactly.

   driver LIBRARY FMI TOKEN STEP COUNT < "SETS (REFERENCE VALUE)* GETS REFERENCE*"
   prints per step one line of hexadecimal floating-point numbers. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *symbol(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *symbol(void *library, const char *name) { return dlsym(library, name); }
#endif

typedef struct {
  void (*logger)(void *, const char *, int, const char *, const char *, ...);
  void *(*allocate)(size_t, size_t);
  void (*release)(void *);
  void (*finished)(void *, int);
  void *environment;
} Callbacks;

static void *library;

static void *need(const char *name) {
  void *found = symbol(library, name);
  if (!found) {
    fprintf(stderr, "the library has no %s\n", name);
    exit(3);
  }
  return found;
}

static void check(int status, const char *what) {
  if (status) {
    fprintf(stderr, "%s returned %d\n", what, status);
    exit(4);
  }
}

#define CALL(name, type) ((int (*) type)need(name))

int main(int argc, char **argv) {
  if (argc != 6) {
    puts("ready");
    return 0;
  }
  const int fmi = atoi(argv[2]), count = atoi(argv[5]);
  const char *token = argv[3];
  const double step = strtod(argv[4], 0);
  library = open_library(argv[1]);
  if (!library) {
    fprintf(stderr, "%s cannot be loaded\n", argv[1]);
    return 2;
  }
  static uint32_t set[4096], get[4096];
  static double given[4096], got[4096];
  int sets = 0, gets = 0;
  if (scanf("%d", &sets) != 1 || sets > 4096) return 5;
  for (int i = 0; i < sets; i++)
    if (scanf("%u %lf", &set[i], &given[i]) != 2) return 5;
  if (scanf("%d", &gets) != 1 || gets > 4096) return 5;
  for (int i = 0; i < gets; i++)
    if (scanf("%u", &get[i]) != 1) return 5;

  static Callbacks callbacks;
  void *c;
  if (fmi == 2) {
    c = ((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))need(
        "fmi2Instantiate"))("x", 1, token, "", &callbacks, 0, 0);
    if (!c) return 6;
    check(CALL("fmi2SetupExperiment", (void *, int, double, double, int, double))(c, 0, 0, 0, 0, 0), "setup");
    check(CALL("fmi2SetReal", (void *, const uint32_t *, size_t, const double *))(c, set, sets, given), "set");
    check(CALL("fmi2EnterInitializationMode", (void *))(c), "enter");
    check(CALL("fmi2ExitInitializationMode", (void *))(c), "exit");
  } else {
    c = ((void *(*)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t,
                    void *, void *, void *))need("fmi3InstantiateCoSimulation"))(
        "x", token, "", false, false, false, false, 0, 0, 0, 0, 0);
    if (!c) return 6;
    check(CALL("fmi3SetFloat64", (void *, const uint32_t *, size_t, const double *, size_t))(c, set, sets, given, sets),
          "set");
    check(CALL("fmi3EnterInitializationMode", (void *, bool, double, double, bool, double))(c, false, 0, 0, false, 0),
          "enter");
    check(CALL("fmi3ExitInitializationMode", (void *))(c), "exit");
  }
  for (int k = 0; k < count; k++) {
    if (fmi == 2) {
      check(CALL("fmi2DoStep", (void *, double, double, int))(c, k * step, step, 1), "step");
      check(CALL("fmi2GetReal", (void *, const uint32_t *, size_t, double *))(c, get, gets, got), "get");
    } else {
      bool event, terminate, early;
      double last;
      check(CALL("fmi3DoStep", (void *, double, double, bool, bool *, bool *, bool *, double *))(
                c, k * step, step, true, &event, &terminate, &early, &last),
            "step");
      check(CALL("fmi3GetFloat64", (void *, const uint32_t *, size_t, double *, size_t))(c, get, gets, got, gets),
            "get");
    }
    for (int i = 0; i < gets; i++) printf("%a%c", got[i], i + 1 < gets ? ' ' : '\n');
  }
  ((void (*)(void *))need(fmi == 2 ? "fmi2FreeInstance" : "fmi3FreeInstance"))(c);
  return 0;
}
