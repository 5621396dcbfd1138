"""A ball for tests, written in C: co-simulation with events and early return in FMI 3.0.

States h and v with h' = v, v' = u[0] + u[1]; at h = 0 the ball bounces with the restitution e. A counter counts the
time events at 0.05 s, 0.1 s, ...; `bounces` counts the bounces.
"""

import subprocess
import zipfile
from pathlib import Path

from lapwing.fmi.export.native_build import compiler

MODEL = r"""
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
typedef struct { double t, x[2], u[2], e, next; int32_t count, bounces; int8_t small; int early; } model;
static model *make(void) { model *m = calloc(1, sizeof *m); m->x[0] = 1.0; m->e = 0.5; m->next = 0.05; return m; }
static void happen(model *m) {
    if (m->x[0] <= 0 && m->x[1] < 0) { m->x[0] = 1e-300; m->x[1] *= -m->e; m->bounces++; }
    if (m->t >= m->next - 1e-12) { m->count++; m->next = 0.05 * (m->count + 1); }
}
static int real(model *m, unsigned r, double **p, size_t *n) {
    static double y[3];
    *n = 1;
    if (r == 1) *p = m->u, *n = 2;
    else if (r == 2) { y[0] = m->x[0]; y[1] = m->x[1]; *p = y, *n = 2; }
    else if (r == 3) *p = &m->e;
    else if (r == 4 || r == 5) *p = &m->x[r - 4];
    else return 3;
    return 0;
}
#define NO(f) int f(void) { return 3; }
#include <stdbool.h>
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(const char *n, const char *t, const char *r, bool v, bool l, bool event, bool early,
                                  const unsigned i[], size_t k, void *e, void *log, void *up) {
    model *m = make(); m->early = event && early; return m;
}
void fmi3FreeInstance(void *m) { free(m); }
int fmi3EnterInitializationMode(void *m, bool a, double b, double c, bool d, double e) { return 0; }
int fmi3ExitInitializationMode(void *m) { return 0; }
int fmi3EnterEventMode(void *m) { return 0; }
int fmi3EnterStepMode(void *m) { return 0; }
int fmi3UpdateDiscreteStates(void *c, bool *again, bool *end, bool *nom, bool *values, bool *has, double *time) {
    model *m = c; happen(m);
    *again = *end = *nom = false; *values = *has = true; *time = m->next;
    return 0;
}
int fmi3SetFloat64(void *c, const unsigned r[], size_t n, const double v[], size_t k) {
    double *p; size_t size;
    for (size_t i = 0; i < n; i++) { if (real(c, r[i], &p, &size)) return 3;
        for (size_t j = 0; j < size; j++) p[j] = *v++;
    }
    return 0;
}
int fmi3GetFloat64(void *c, const unsigned r[], size_t n, double v[], size_t k) {
    double *p; size_t size;
    for (size_t i = 0; i < n; i++) { if (real(c, r[i], &p, &size)) return 3;
        for (size_t j = 0; j < size; j++) *v++ = p[j];
    }
    return 0;
}
int fmi3GetInt32(void *c, const unsigned r[], size_t n, int32_t v[], size_t k) {
    for (size_t i = 0; i < n; i++) v[i] = r[i] == 6 ? ((model *)c)->count : ((model *)c)->bounces;
    return 0;
}
int fmi3SetInt8(void *c, const unsigned r[], size_t n, const int8_t v[], size_t k) {
    ((model *)c)->small = v[0]; return 0;
}
int fmi3GetInt8(void *c, const unsigned r[], size_t n, int8_t v[], size_t k) { v[0] = ((model *)c)->small; return 0; }
int fmi3SetBinary(void *c, const unsigned r[], size_t n, const size_t sizes[], const uint8_t *v[], size_t k) {
    ((model *)c)->e = v[0][sizes[0] - 1] / 256.0; return 0;
}
int fmi3DoStep(void *c, double t, double h, bool a, bool *event, bool *end, bool *early, double *reached) {
    model *m = c;
    double g = m->u[0] + m->u[1], v = m->x[1], s = g < 0 ? (-v - sqrt(v * v - 2 * g * m->x[0])) / g : h + 1;
    double stop = fmin(t + h, m->next), go = fmin(fmax(s, 0), stop - t);
    m->x[0] += go * (v + 0.5 * g * go), m->x[1] += g * go, m->t = t + go;
    if (s <= stop - t) m->x[0] = 0;
    *event = s <= stop - t || m->t >= m->next - 1e-12;
    *end = false, *early = m->t < t + h, *reached = m->t;
    return m->early ? 0 : 3;
}
#define N2(a, b) NO(fmi3Get##a) NO(fmi3Set##a) NO(fmi3Get##b) NO(fmi3Set##b)
N2(Float32, UInt8) N2(Int16, UInt16) N2(UInt32, Int64) N2(UInt64, Boolean)
NO(fmi3GetString) NO(fmi3SetString) NO(fmi3GetBinary) NO(fmi3SetInt32) NO(fmi3EnterContinuousTimeMode)
NO(fmi3CompletedIntegratorStep) NO(fmi3SetTime) NO(fmi3SetContinuousStates) NO(fmi3GetContinuousStates)
NO(fmi3GetContinuousStateDerivatives) NO(fmi3GetEventIndicators) NO(fmi3GetNumberOfContinuousStates)
NO(fmi3GetNumberOfEventIndicators)
N2(Clock, IntervalDecimal)
N2(IntervalFraction, ShiftDecimal) N2(ShiftFraction, FMUState) NO(fmi3SetDebugLogging)
NO(fmi3InstantiateModelExchange) NO(fmi3InstantiateScheduledExecution) NO(fmi3Terminate) NO(fmi3Reset)
NO(fmi3FreeFMUState)
NO(fmi3SerializedFMUStateSize) NO(fmi3SerializeFMUState) NO(fmi3DeserializeFMUState) NO(fmi3GetDirectionalDerivative)
NO(fmi3GetAdjointDerivative) NO(fmi3EnterConfigurationMode) NO(fmi3ExitConfigurationMode)
NO(fmi3GetNumberOfVariableDependencies) NO(fmi3GetVariableDependencies) NO(fmi3EvaluateDiscreteStates)
NO(fmi3GetNominalsOfContinuousStates) NO(fmi3GetOutputDerivatives) NO(fmi3ActivateModelPartition)
"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="ball" instantiationToken="ball">
  <{kind} modelIdentifier="ball"{more}/>
  <UnitDefinitions><Unit name="foot"><BaseUnit m="1" factor="0.3048"/></Unit>
    <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="u" valueReference="1" causality="input" start="0 0"><Dimension start="2"/></Float64>
    <Float64 name="y" valueReference="2" causality="output"><Dimension start="2"/></Float64>
    <Float64 name="e" valueReference="3" causality="parameter" variability="fixed" start="0.5"/>
    <Float64 name="h" valueReference="4" causality="output" initial="exact" start="1"{unit}/>
    <Float64 name="v" valueReference="5" causality="output" initial="exact" start="0"/>
    <Float64 name="der(h)" valueReference="10" causality="local" derivative="4"/>
    <Float64 name="der(v)" valueReference="11" causality="local" derivative="5"/>
    <Int32 name="count" valueReference="6" causality="output"/>
    <Int32 name="bounces" valueReference="7" causality="output"/>
    <Int8 name="small" valueReference="13" causality="input" start="0"/>
    <Binary name="blob" valueReference="14" causality="parameter" variability="fixed"><Start value="00"/>
    </Binary>{variables}
  </ModelVariables>
  <ModelStructure><Output valueReference="2"/><Output valueReference="4"/><Output valueReference="5"/>
    <Output valueReference="6"/><Output valueReference="7"/><ContinuousStateDerivative valueReference="10"/>
    <ContinuousStateDerivative valueReference="11"/><EventIndicator valueReference="4"/></ModelStructure>
</fmiModelDescription>
"""


def write_event_fmu(path: Path, kind: str = "CoSimulation", unit: str = "", variables: str = "") -> None:
    """Compile and write the FMU.

    Args:
        path: of the FMU.
        kind: interface that its description declares; the library has CoSimulation only.
        unit: of the height h.
        variables: XML of further variables.
    """
    source, library = path.with_suffix(".c"), path.with_suffix(".so")
    source.write_text(MODEL)
    subprocess.run([*compiler(), "-w", "-shared", "-fPIC", "-O1", str(source), "-lm", "-o", str(library)], check=True)
    more = ' hasEventMode="true" mightReturnEarlyFromDoStep="true"' if kind == "CoSimulation" else ""
    unit = f' unit="{unit}"' if unit else ""
    with zipfile.ZipFile(path, "w") as archive:
        text = DESCRIPTION.format(kind=kind, more=more, unit=unit, variables=variables)
        archive.writestr("modelDescription.xml", text)
        archive.write(library, "binaries/x86_64-linux/ball.so")
