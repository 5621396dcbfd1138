"""An FMU for tests with a battery, motors and a wind, written in C: outputs for the named inputs of effects."""

import subprocess
import zipfile
from pathlib import Path

from small_fmu import SOURCE

from lapwing.fmi.export.native_build import compiler

ROTORS = 4
INPUTS = [f"{name}_{k}" for name in ("voltage", "speed", "current") for k in range(ROTORS)]
OUTPUTS = ["supply", "charge", "wind_x", "wind_y", "wind_z", *(f"torque_{k}" for k in range(ROTORS)), "next_speed"]
PARAMETERS = ["open_circuit", "resistance", "wind", "torque_constant", "speed_constant", "winding"]
UNITS = {"supply": "V", "wind_x": "m/s", "wind_y": "m/s", "wind_z": "m/s", "next_speed": "rad/s"}
MODEL = r"""
enum { OPEN = 22, RESISTANCE, WIND, TORQUE, SPEED, WINDING, SIZE };
typedef struct { double x[SIZE]; } model;
static int outputs(model *m, double t) {
    double *x = m->x, sum = 0.0;
    for (int k = 0; k < 4; k++) sum += x[8 + k];
    x[12] = x[OPEN] - x[RESISTANCE] * sum;
    x[13] = 1.0 - 0.01 * t;
    x[14] = x[WIND], x[15] = 0.5 * x[WIND], x[16] = 0.0;
    for (int k = 0; k < 4; k++) x[17 + k] = x[TORQUE] * (x[k] - x[SPEED] * x[4 + k]) / x[WINDING];
    x[21] = 10.0 + t;
    return 0;
}
int fmi2ExitInitializationMode(void *m) { return outputs(m, 0.0); }
int fmi2SetReal(void *c, const unsigned r[], size_t n, const double x[]) {
    for (size_t i = 0; i < n; i++) ((model *)c)->x[r[i] - 1] = x[i];
    return 0;
}
int fmi2GetReal(void *c, const unsigned r[], size_t n, double x[]) {
    for (size_t i = 0; i < n; i++) x[i] = ((model *)c)->x[r[i] - 1];
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int p) { return outputs(c, t + h); }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *c, int v, int l) {
    return calloc(1, sizeof(model));
}
"""


def write_effect_fmu(path: Path) -> None:
    """Compile and write the FMU."""
    head, rest = SOURCE.split("typedef struct", 1)
    version, tail = rest.split("void *fmi2Instantiate", 1)
    common = "const char *" + version.split("const char *", 1)[1]
    begin, end = tail.index("void fmi2FreeInstance"), tail.index("int fmi2ExitInitializationMode")
    terminate, set_real = tail.index("int fmi2Terminate"), tail.index("int fmi2SetReal")
    source = head + MODEL + common + tail[begin:end] + tail[terminate:set_real] + tail[tail.index("#define NO") :]
    source += "NO(fmi2SetInteger) NO(fmi2GetInteger) NO(fmi2SetString)\n"
    c_file, library = path.with_suffix(".c"), path.with_suffix(".so")
    c_file.write_text(source)
    subprocess.run([*compiler(), "-w", "-ffp-contract=off", "-shared", "-fPIC", c_file, "-o", library], check=True)
    lines = []
    for k, name in enumerate([*INPUTS, *OUTPUTS, *PARAMETERS], 1):
        is_input, is_parameter = name in INPUTS, name in PARAMETERS
        causality = "input" if is_input else 'parameter" variability="fixed' if is_parameter else "output"
        start = ' start="0"' if is_input or is_parameter else ""
        unit = f' unit="{UNITS[name]}"' if name in UNITS else ""
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}"><Real{start}{unit}/>'
            "</ScalarVariable>"
        )
    description = (
        '<fmiModelDescription fmiVersion="2.0" modelName="parts" guid="{parts}" numberOfEventIndicators="0">'
        f'<CoSimulation modelIdentifier="parts"/><ModelVariables>{"".join(lines)}</ModelVariables>'
        "<ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, "binaries/linux64/parts.so")
