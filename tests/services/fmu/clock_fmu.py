"""An FMU for scheduled execution, written in C, with a periodic, a triggered and a countdown clock.

Partition 1 (periodic) counts its ticks and copies u to y; at its third tick it starts the countdown `wait`. Partitions
2 (triggered) and 3 (countdown) count theirs. `order` has the digits of the partitions that ran at the present time. The
output clock `even` ticks at every second tick of partition 1.
"""

import subprocess
import zipfile
from pathlib import Path

from lapwing.fmi.native_build import compiler

SOURCE = r"""
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
typedef struct { double time, u, y, wait; int32_t count[3], order; bool even; int qualifier; } model;
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateScheduledExecution(const char *n, const char *t, const char *r, bool v, bool l, void *e, void *log,
                                        void *update, void *lock, void *unlock) {
    model *m = calloc(1, sizeof *m); m->time = -1.0; m->wait = 0.1; return m;
}
void fmi3FreeInstance(void *m) { free(m); }
int fmi3EnterInitializationMode(void *m, bool a, double b, double c, bool d, double e) { return 0; }
int fmi3ExitInitializationMode(void *m) { return 0; }
int fmi3Terminate(void *m) { return 0; }
int fmi3SetFloat64(void *c, const unsigned r[], size_t n, const double x[], size_t k) {
    for (size_t i = 0; i < n; i++) *(r[i] == 10 ? &((model *)c)->u : &((model *)c)->wait) = x[i];
    return 0;
}
int fmi3GetFloat64(void *c, const unsigned r[], size_t n, double x[], size_t k) {
    for (size_t i = 0; i < n; i++) x[i] = ((model *)c)->y;
    return 0;
}
int fmi3GetInt32(void *c, const unsigned r[], size_t n, int32_t x[], size_t k) {
    model *m = c;
    for (size_t i = 0; i < n; i++) x[i] = r[i] == 15 ? m->order : m->count[r[i] - 12];
    return 0;
}
int fmi3GetClock(void *c, const unsigned r[], size_t n, bool x[]) {
    x[0] = ((model *)c)->even; ((model *)c)->even = false;
    return 0;
}
int fmi3GetIntervalDecimal(void *c, const unsigned r[], size_t n, double x[], int q[]) {
    model *m = c;
    x[0] = m->wait; q[0] = m->qualifier; m->qualifier = m->qualifier ? 1 : 0;
    return 0;
}
int fmi3ActivateModelPartition(void *c, unsigned clock, double time) {
    model *m = c;
    int k = clock - 1;
    if (m->wait < 0) return 3;
    m->order = (time == m->time ? 10 * m->order : 0) + k + 1;
    m->time = time;
    m->count[k]++;
    if (k == 0) {
        m->y = m->u, m->even = m->count[0] % 2 == 0;
        if (m->count[0] == 3) m->qualifier = 2;
    }
    return 0;
}
#define NO(f) int f(void) { return 3; }
NO(fmi3CompletedIntegratorStep) NO(fmi3DeserializeFMUState) NO(fmi3DoStep) NO(fmi3EnterConfigurationMode)
NO(fmi3EnterContinuousTimeMode) NO(fmi3EnterEventMode) NO(fmi3EnterStepMode) NO(fmi3EvaluateDiscreteStates)
NO(fmi3ExitConfigurationMode) NO(fmi3FreeFMUState) NO(fmi3GetAdjointDerivative) NO(fmi3GetBinary) NO(fmi3GetBoolean)
NO(fmi3GetContinuousStateDerivatives) NO(fmi3GetContinuousStates) NO(fmi3GetDirectionalDerivative)
NO(fmi3GetEventIndicators) NO(fmi3GetFMUState) NO(fmi3GetFloat32) NO(fmi3GetInt16) NO(fmi3GetInt64) NO(fmi3GetInt8)
NO(fmi3GetIntervalFraction) NO(fmi3GetNominalsOfContinuousStates) NO(fmi3GetNumberOfContinuousStates)
NO(fmi3GetNumberOfEventIndicators) NO(fmi3GetNumberOfVariableDependencies) NO(fmi3GetOutputDerivatives)
NO(fmi3GetShiftDecimal) NO(fmi3GetShiftFraction) NO(fmi3GetString) NO(fmi3GetUInt16) NO(fmi3GetUInt32)
NO(fmi3GetUInt64) NO(fmi3GetUInt8) NO(fmi3GetVariableDependencies) NO(fmi3InstantiateCoSimulation)
NO(fmi3InstantiateModelExchange) NO(fmi3Reset) NO(fmi3SerializeFMUState) NO(fmi3SerializedFMUStateSize)
NO(fmi3SetBinary) NO(fmi3SetBoolean) NO(fmi3SetClock) NO(fmi3SetContinuousStates) NO(fmi3SetDebugLogging)
NO(fmi3SetFMUState) NO(fmi3SetFloat32) NO(fmi3SetInt16) NO(fmi3SetInt32) NO(fmi3SetInt64) NO(fmi3SetInt8)
NO(fmi3SetIntervalDecimal) NO(fmi3SetIntervalFraction) NO(fmi3SetShiftDecimal) NO(fmi3SetShiftFraction)
NO(fmi3SetString) NO(fmi3SetTime) NO(fmi3SetUInt16) NO(fmi3SetUInt32) NO(fmi3SetUInt64) NO(fmi3SetUInt8)
NO(fmi3UpdateDiscreteStates)
"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="clocks" instantiationToken="clocks">
  <ScheduledExecution modelIdentifier="clocks"/>
  <ModelVariables>
    <Clock name="periodic" valueReference="1" causality="input" priority="1" {periodic}/>
    <Clock name="triggered" valueReference="2" causality="input" priority="2" intervalVariability="triggered"/>
    <Clock name="countdown" valueReference="3" causality="input" priority="0" intervalVariability="countdown"/>
    <Clock name="even" valueReference="4" causality="output" intervalVariability="triggered" clocks="1"/>
    <Float64 name="u" valueReference="10" causality="input" start="0"/>
    <Float64 name="y" valueReference="11" causality="output" clocks="1"/>
    <Int32 name="periodic_ticks" valueReference="12" causality="output" clocks="1"/>
    <Int32 name="triggered_ticks" valueReference="13" causality="output" clocks="2"/>
    <Int32 name="countdown_ticks" valueReference="14" causality="output" clocks="3"/>
    <Int32 name="order" valueReference="15" causality="output" clocks="1 2 3"/>
    <Float64 name="wait" valueReference="16" causality="parameter" variability="fixed" start="0.1"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="4"/><Output valueReference="11"/><Output valueReference="12"/>
    <Output valueReference="13"/><Output valueReference="14"/><Output valueReference="15"/></ModelStructure>
</fmiModelDescription>
"""


def write_clock_fmu(path: Path, periodic: str = 'intervalVariability="constant" intervalDecimal="0.1"') -> None:
    """Compile and write the FMU; `periodic` are attributes of its periodic clock."""
    source, library = path.with_suffix(".c"), path.with_suffix(".so")
    source.write_text(SOURCE)
    subprocess.run([*compiler(), "-w", "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(periodic=periodic))
        archive.write(library, "binaries/x86_64-linux/clocks.so")
