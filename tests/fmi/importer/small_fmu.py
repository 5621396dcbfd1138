"""A small FMU for tests, written in C: y = gain * u, and a fault of choice at t = 0.5 s.

Its integer has the value reference of its input, as FMI 2.0 permits for variables of different types.
"""

import subprocess
import zipfile
from pathlib import Path

from lapwing.fmi.export.native_build import compiler

SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <unistd.h>
typedef struct { double u, y, gain; int fault; } model;
enum { NONE, CRASH, HANG, FAIL, NAN_OUTPUT, EXIT, SLOW };
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *c, int v, int l) {
    model *m = calloc(1, sizeof *m);
    m->gain = 1.0;
    return m;
}
void fmi2FreeInstance(void *m) { free(m); }
int fmi2SetupExperiment(void *m, int a, double b, double c, int d, double e) { return 0; }
int fmi2EnterInitializationMode(void *m) { return 0; }
int fmi2ExitInitializationMode(void *c) { model *m = c; m->y = m->gain * m->u; return 0; }
int fmi2Terminate(void *m) { return 0; }
int fmi2Reset(void *m) { return 0; }
int fmi2SetReal(void *c, const unsigned r[], size_t n, const double x[]) {
    model *m = c;
    for (size_t i = 0; i < n; i++) *(r[i] == 1 ? &m->u : &m->gain) = x[i];
    return 0;
}
int fmi2GetReal(void *c, const unsigned r[], size_t n, double x[]) {
    model *m = c;
    for (size_t i = 0; i < n; i++) x[i] = r[i] == 2 ? m->y : r[i] == 1 ? m->u : m->gain;
    return 0;
}
int fmi2SetInteger(void *c, const unsigned r[], size_t n, const int x[]) { ((model *)c)->fault = x[0]; return 0; }
int fmi2SetString(void *c, const unsigned r[], size_t n, const char *x[]) { ((model *)c)->gain = atof(x[0]); return 0; }
int fmi2GetInteger(void *c, const unsigned r[], size_t n, int x[]) { x[0] = ((model *)c)->fault; return 0; }
int fmi2DoStep(void *c, double t, double h, int p) {
    model *m = c;
    m->y = m->gain * m->u;
    if (t + h < 0.5 - 1e-9) return 0;
    if (m->fault == CRASH) *(volatile int *)8 = 1;
    if (m->fault == HANG) for (;;) pause();
    if (m->fault == FAIL) return 3;
    if (m->fault == NAN_OUTPUT) m->y = NAN;
    if (m->fault == EXIT) _exit(7);
    if (m->fault == SLOW && t < 0.5 - 1e-9) sleep(4);
    return 0;
}
#define NO(f) int f(void) { return 3; }
NO(fmi2SetDebugLogging) NO(fmi2GetBoolean) NO(fmi2SetBoolean) NO(fmi2GetString)
NO(fmi2GetFMUstate) NO(fmi2SetFMUstate) NO(fmi2FreeFMUstate) NO(fmi2SerializedFMUstateSize) NO(fmi2SerializeFMUstate)
NO(fmi2DeSerializeFMUstate) NO(fmi2GetDirectionalDerivative) NO(fmi2SetRealInputDerivatives)
NO(fmi2GetRealOutputDerivatives) NO(fmi2CancelStep) NO(fmi2GetStatus) NO(fmi2GetRealStatus) NO(fmi2GetIntegerStatus)
NO(fmi2GetBooleanStatus) NO(fmi2GetStringStatus)
"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="small" guid="{{small}}" numberOfEventIndicators="0">
  <{kind} modelIdentifier="small"/>
  <UnitDefinitions>
    <Unit name="ft"><BaseUnit m="1" factor="0.3048"/></Unit>
    <Unit name="V"><BaseUnit kg="1" m="2" s="-3" A="-1"/></Unit>
    <Unit name="m"><BaseUnit m="1"/></Unit>
  </UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"{unit_u}/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output"><Real{unit_y}/></ScalarVariable>
    <ScalarVariable name="gain" valueReference="3" causality="parameter" variability="fixed"><Real start="1"/>
    </ScalarVariable>
    <ScalarVariable name="fault" valueReference="1" causality="parameter" variability="fixed"><Integer start="0"/>
    </ScalarVariable>
    <ScalarVariable name="label" valueReference="5" causality="parameter" variability="fixed"><String start="a"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def write_small_fmu(
    path: Path, unit_u: str = "", unit_y: str = "", platform: str = "linux64", kind: str = "CoSimulation"
) -> None:
    """Compile and write the FMU."""
    source, library = path.with_suffix(".c"), path.with_suffix(".so")
    source.write_text(SOURCE)
    subprocess.run([*compiler(), "-w", "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    units = {name: f' unit="{unit}"' if unit else "" for name, unit in (("unit_u", unit_u), ("unit_y", unit_y))}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(kind=kind, **units))
        archive.write(library, f"binaries/{platform}/small.so")
