/* An FMU of FMI 2 (y = 2 u + x, x' = 1) that fails as its instance's name says: bad_PHASE_KIND. */
#define _GNU_SOURCE
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif
#define EXPORT __attribute__((visibility("default")))

typedef struct {
  void (*logger)(void *, const char *, int, const char *, const char *, ...);
  void *allocate, *release, *finished, *environment;
} Callbacks;
typedef struct { double u, x; char phase[16], kind[16]; const Callbacks *host; char name[64]; } Model;

static const char *KINDS[] = {"ok", "warning", "discard", "error", "fatal", "pending"};
extern int pthread_create(unsigned long *, const void *, void *(*)(void *), void *);
static volatile int deep;
static int overflow(int n) { volatile char space[4096]; space[0] = (char)n; deep = n; return overflow(n + 1) + space[0]; }
static void *crash(void *unused) { *(volatile int *)8 = 1; return unused; }
static void *stay(void *unused) { for (;;) usleep(1000); return unused; }

/* What the phase does; its status. */
static int act(Model *m, const char *phase) {
  if (strcmp(m->phase, phase)) return 0;
  const char *k = m->kind;
  if (!strcmp(phase, "step") && m->x < 0.3) return 0;
  for (int i = 1; i < 6; i++) if (!strcmp(k, KINDS[i])) return i;
  if (!strncmp(k, "status", 6)) return atoi(k + 6);
  if (!strcmp(k, "negative")) return -1;
  if (!strcmp(k, "exit0")) exit(0);
  if (!strcmp(k, "exit3")) exit(3);
  if (!strcmp(k, "_exit0")) _exit(0);
  if (!strcmp(k, "segv")) *(volatile int *)8 = 1;
  if (!strcmp(k, "abort")) abort();
  if (!strcmp(k, "fpe")) raise(SIGFPE);
  if (!strcmp(k, "illegal")) __builtin_trap();
  if (!strcmp(k, "bus")) raise(SIGBUS);
  if (!strcmp(k, "kill")) raise(SIGKILL);
  if (!strcmp(k, "term")) raise(SIGTERM);
  if (!strcmp(k, "stack")) overflow(0);
  if (!strcmp(k, "hang")) for (;;) usleep(1000);
  if (!strcmp(k, "spin")) for (volatile int i = 0;; i++) ;
  if (!strcmp(k, "nan")) m->x = NAN;
  if (!strcmp(k, "inf")) m->x = INFINITY;
  if (!strcmp(k, "chdir") && chdir("/")) return 3;
  if (!strcmp(k, "umask")) umask(0777);
  if (!strcmp(k, "round")) fesetround(FE_UPWARD);
#if defined(__x86_64__)
  if (!strcmp(k, "ftz")) _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
  if (!strcmp(k, "locale")) setlocale(LC_NUMERIC, "C.UTF-8");
  if (!strcmp(k, "signal")) signal(SIGTERM, SIG_IGN);
  if (!strcmp(k, "prints")) { puts("printed by the FMU"); fflush(stdout); }
  if (!strcmp(k, "logs")) for (int i = 0; i < 20000; i++) m->host->logger(m->host->environment, m->name, 3, "all", "line %d", i);
  if (!strcmp(k, "long")) { char *s = malloc(100001); memset(s, 'a', 100000); s[100000] = 0; m->host->logger(m->host->environment, m->name, 3, "all", s); free(s); }
  if (!strcmp(k, "format")) m->host->logger(m->host->environment, m->name, 3, "all", "%y %d %s", 1, "text");
  if (!strcmp(k, "null")) m->host->logger(m->host->environment, 0, 3, 0, 0);
  if (!strcmp(k, "bytes")) { m->host->logger(m->host->environment, m->name, 3, "all", "\xff\xfe"); return 3; }
  if (!strcmp(k, "thread")) { unsigned long t; pthread_create(&t, 0, stay, 0); }
  if (!strcmp(k, "threadsegv")) { unsigned long t; pthread_create(&t, 0, crash, 0); usleep(2000000); }
  if (!strcmp(k, "child")) { if (!fork()) { for (;;) sleep(1); } }
  if (!strcmp(k, "heap")) { char *volatile p = malloc(24); for (int i = -16; i < 64; i++) ((volatile char *)p)[i] = -1; free(p); }
  if (!strcmp(k, "twice")) { char *volatile p = malloc(4000); char *volatile keep = malloc(4000); free(p); free(p); free(keep); }
  return 0;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *host, int visible, int logging) {
  Model *m = calloc(1, sizeof(Model));
  m->host = host;
  strncpy(m->name, name, 63);
  sscanf(name, "bad_%15[a-z]_%15[a-z0-9_]", m->phase, m->kind);
  act(m, "create");
  if (!strcmp(m->kind, "guid") || !strcmp(m->kind, "refused")) {
    host->logger(host->environment, name, 3, "error", m->kind[0] == 'g' ? "GUID %s is not mine" : "no licence for %s", guid);
    return 0;
  }
  if (!strcmp(m->phase, "create") && !strcmp(m->kind, "resources")) {
    char path[600];
    snprintf(path, 600, "%s/../modelDescription.xml", resources + 7);
    FILE *f = fopen(path, "w");
    if (f) { fputs("overwritten", f); fclose(f); }
  }
  return m;
}
EXPORT void fmi2FreeInstance(void *c) { act(c, "free"); free(c); }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
EXPORT int fmi2SetupExperiment(void *c, int a, double b, double t, int d, double e) { return act(c, "setup"); }
EXPORT int fmi2EnterInitializationMode(void *c) { return act(c, "init"); }
EXPORT int fmi2ExitInitializationMode(void *c) { return act(c, "exitinit"); }
EXPORT int fmi2Terminate(void *c) { return act(c, "terminate"); }
EXPORT int fmi2Reset(void *c) { return 0; }
EXPORT int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
  Model *m = c;
  int status = m->x >= 0.3 ? act(m, "get") : 0;
  for (size_t i = 0; i < n; i++) v[i] = r[i] == 1 ? m->u : 2.0 * m->u + m->x;
  return status;
}
EXPORT int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
  Model *m = c;
  int status = m->x >= 0.3 ? act(m, "set") : 0;
  for (size_t i = 0; i < n; i++) if (r[i] == 1) m->u = v[i];
  return status;
}
#define NONE(name) EXPORT int name(void *c, void *r, size_t n, void *v) { return n ? 3 : 0; }
NONE(fmi2GetInteger) NONE(fmi2SetInteger) NONE(fmi2GetBoolean) NONE(fmi2SetBoolean)
NONE(fmi2SetString)
EXPORT int fmi2GetString(void *c, const unsigned r[], size_t n, const char *v[]) {
  Model *m = c;
  for (size_t i = 0; i < n; i++) v[i] = strcmp(m->kind, "string") ? "text" : 0;
  return 0;
}
EXPORT int fmi2DoStep(void *c, double t, double h, int keep) {
  Model *m = c;
  m->x += h;
  return act(m, "step");
}
