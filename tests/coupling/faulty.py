"""A small FMU in C that misbehaves on request: y = 2 u, x' = 1, until `fail_at`."""

from __future__ import annotations

import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

from sources.packaging.native import compile_c
from sources.packaging.platforms import host_platform

MODES = {"error": 1, "discard": 2, "fatal": 3, "nan": 4, "crash": 5, "hang": 6, "exit": 7}

CODE = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))
typedef struct { double u, x, fail_at; int mode; } Model;
static Model *make(void) { Model *m = calloc(1, sizeof(Model)); m->fail_at = 1e9; return m; }
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f,
                             int v, int l) { return make(); }
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
EXPORT int fmi2SetupExperiment(void *c, int a, double b, double t, int d, double e) { return 0; }
EXPORT int fmi2EnterInitializationMode(void *c) { return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { return 0; }
EXPORT int fmi2Terminate(void *c) { return 0; }
EXPORT int fmi2Reset(void *c) { Model *m = c; memset(m, 0, sizeof *m); m->fail_at = 1e9; return 0; }
EXPORT int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
  const Model *m = c;
  for (size_t i = 0; i < n; i++)
    v[i] = r[i] == 1 ? m->u : r[i] == 2 ? 2.0 * m->u + m->x : r[i] == 3 ? m->fail_at : m->mode;
  return 0;
}
EXPORT int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
  Model *m = c;
  for (size_t i = 0; i < n; i++)
    if (r[i] == 1) m->u = v[i];
    else if (r[i] == 3) m->fail_at = v[i];
    else if (r[i] == 4) m->mode = (int)v[i];
  return 0;
}
#define NONE(name) EXPORT int name(void *c, void *r, size_t n, void *v) { return n ? 3 : 0; }
NONE(fmi2GetInteger) NONE(fmi2SetInteger) NONE(fmi2GetBoolean) NONE(fmi2SetBoolean)
NONE(fmi2GetString) NONE(fmi2SetString)
#define REFUSED(name) EXPORT int name(void *c, void *a, size_t b, void *d) { return 3; }
@STATES@
REFUSED(fmi2SerializedFMUstateSize) REFUSED(fmi2SerializeFMUstate)
REFUSED(fmi2DeSerializeFMUstate) REFUSED(fmi2SetRealInputDerivatives)
REFUSED(fmi2GetRealOutputDerivatives) REFUSED(fmi2CancelStep) REFUSED(fmi2GetStatus)
REFUSED(fmi2GetRealStatus) REFUSED(fmi2GetIntegerStatus) REFUSED(fmi2GetBooleanStatus)
REFUSED(fmi2GetStringStatus)
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned a[], size_t n, const unsigned b[],
                                        size_t k, const double s[], double v[]) { return 3; }
EXPORT int fmi2DoStep(void *c, double t, double h, int keep) {
  Model *m = c;
  m->x += h;
  if (t + h < m->fail_at) return 0;
  switch (m->mode) {
    case 1: return 3;
    case 2: return 2;
    case 3: return 4;
    case 4: m->x = NAN; return 0;
    case 5: abort();
    case 6: for (volatile int i = 0;; i++) ;
    case 7: exit(0);
  }
  return 0;
}
"""

REFUSES = "REFUSED(fmi2GetFMUstate) REFUSED(fmi2SetFMUstate) REFUSED(fmi2FreeFMUstate)"
KEEPS = """
EXPORT int fmi2GetFMUstate(void *c, void **s) {
  *s = malloc(sizeof(Model));
  memcpy(*s, c, sizeof(Model));
  return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *s) { memcpy(c, s, sizeof(Model)); return 0; }
EXPORT int fmi2FreeFMUstate(void *c, void **s) { free(*s); *s = 0; return 0; }
"""

XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="faulty" guid="{0}">
  <CoSimulation modelIdentifier="faulty" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUstate="true" providesDirectionalDerivative="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="1" causality="input" variability="continuous">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output" variability="continuous"
      initial="calculated"><Real/></ScalarVariable>
    <ScalarVariable name="fail_at" valueReference="3" causality="parameter" variability="fixed">
      <Real start="1e9"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="4" causality="parameter" variability="fixed">
      <Real start="0"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies="1"/></Outputs>
    <InitialUnknowns><Unknown index="2" dependencies="1"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""


def build_faulty(folder: Path, *, keeps: bool = False, **claims: str) -> Path:
    """Build it for this machine. It claims states and derivatives, and refuses both.

    Args:
        folder: where it goes.
        keeps: whether it keeps the states that it claims to keep.
        claims: other capabilities, or other values of them.
    """
    code = CODE.replace("@STATES@", KEEPS if keeps else REFUSES)
    binary = compile_c({"faulty.c": code}, "faulty.c", "faulty", host_platform())
    path = folder / "faulty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", claiming(claims))
        archive.writestr("binaries/linux64/faulty.so", binary)
    return path


def claiming(claims: dict[str, str]) -> str:
    """The model description with these capabilities of the co-simulation interface."""
    root = ET.fromstring(XML)
    interface = root.find("CoSimulation")
    assert interface is not None
    interface.attrib.update(claims)
    return ET.tostring(root, encoding="unicode")
