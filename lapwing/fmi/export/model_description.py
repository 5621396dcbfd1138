"""modelDescription.xml of an FMU for co-simulation, FMI 2.0 or 3.0."""

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from lapwing.fmi.export import variables as kinds
from lapwing.fmi.export.exported_part import ExportedPart
from lapwing.fmi.export.variables import Variable
from lapwing.fmi.field_units import parse_unit

QUANTITIES = {
    "m": "Length",
    "m/s": "Velocity",
    "m/s^2": "Acceleration",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s^2": "AngularAcceleration",
    "kg": "Mass",
    "kg m^2": "MomentOfInertia",
    "N": "Force",
    "N m": "Torque",
    "V": "Voltage",
    "A": "Current",
    "W": "Power",
    "Pa": "Pressure",
    "K": "Temperature",
    "T": "MagneticFluxDensity",
    "kg/m^3": "Density",
    "s": "Time",
}
TYPES = {  # type in the description by version of FMI and type of the variable
    2: {kinds.REAL: "Real", kinds.INTEGER: "Integer", kinds.BOOLEAN: "Boolean"},
    3: {kinds.REAL: "Float64", kinds.INTEGER: "Int32", kinds.BOOLEAN: "Boolean"},
}


class ModelNames(NamedTuple):
    """Names of the model in the description."""

    identifier: str  # name of the binary
    token: str  # instantiation token (FMI 3.0) or GUID (FMI 2.0)
    tool: str  # "Lapwing 0.2.0"


def description(part: ExportedPart, variables: Sequence[Variable], names: ModelNames, version: int) -> bytes:
    """Return the text of modelDescription.xml.

    Args:
        part: part to export.
        variables: variables in the order of their value references from 1.
        names: names of the model.
        version: 2 or 3.
    """
    config = part.config
    common = {
        "fmiVersion": f"{version}.0",
        "modelName": f"{config.scene} {part.name}",
        "instantiationToken" if version == 3 else "guid": names.token,
        "description": config.title,
        "generationTool": names.tool,
    }
    if version == 2:
        common |= {"variableNamingConvention": "structured", "numberOfEventIndicators": "0"}
    else:
        common["variableNamingConvention"] = "structured"
    root = Xml.Element("fmiModelDescription", common)
    Xml.SubElement(root, "CoSimulation", _capabilities(part, names.identifier, version))
    _units(root, variables, version)
    categories = Xml.SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusError"):
        Xml.SubElement(categories, "Category", {"name": name})
    Xml.SubElement(
        root,
        "DefaultExperiment",
        {"startTime": "0", "stopTime": repr(config.duration), "stepSize": repr(config.interval)},
    )
    listed = Xml.SubElement(root, "ModelVariables")
    _time(listed, version)
    for reference, variable in enumerate(variables, 1):
        (_variable3 if version == 3 else _variable2)(listed, reference, variable)
    _structure(root, part, variables, version)
    Xml.indent(root)
    return Xml.tostring(root, "utf-8", xml_declaration=True) + b"\n"


def _capabilities(part: ExportedPart, identifier: str, version: int) -> dict[str, str]:
    state = "State" if version == 3 else "state"
    attributes = {
        "modelIdentifier": identifier,
        "canHandleVariableCommunicationStepSize": "true",
        f"canGetAndSetFMU{state}": "true",
        f"canSerializeFMU{state}": "true",
    }
    if version == 3:
        attributes |= {"hasEventMode": "true", "fixedInternalStepSize": repr(part.config.interval)}
    return attributes


def _units(root: Xml.Element, variables: Sequence[Variable], version: int) -> None:
    names = sorted({variable.unit for variable in variables if variable.unit} | {"s"})
    units = Xml.SubElement(root, "UnitDefinitions")
    for name in names:
        unit = parse_unit(name)
        assert unit is not None
        base = {key: str(n) for key, n in unit.powers} | ({"factor": repr(unit.factor)} if unit.factor != 1.0 else {})
        Xml.SubElement(Xml.SubElement(units, "Unit", {"name": name}), "BaseUnit", base)
    definitions = Xml.SubElement(root, "TypeDefinitions")
    for name in names:
        if quantity := QUANTITIES.get(name):
            attributes = {"quantity": quantity, "unit": name}
            if version == 3:
                Xml.SubElement(definitions, "Float64Type", {"name": quantity, **attributes})
            else:
                Xml.SubElement(Xml.SubElement(definitions, "SimpleType", {"name": quantity}), "Real", attributes)


def _time(listed: Xml.Element, version: int) -> None:
    attributes = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    if version == 3:
        Xml.SubElement(listed, "Float64", {**attributes, "declaredType": "Time", "unit": "s"})
    else:
        Xml.SubElement(
            Xml.SubElement(listed, "ScalarVariable", attributes), "Real", {"declaredType": "Time", "unit": "s"}
        )


def _common(reference: int, v: Variable) -> dict[str, str]:
    attributes = {"name": v.name, "valueReference": str(reference), "causality": v.causality}
    if v.causality == kinds.PARAMETER:
        attributes["variability"] = "tunable"
    elif v.type != kinds.REAL:
        attributes["variability"] = "discrete"
    if v.causality == kinds.STATE:
        attributes["initial"] = "exact"
    return attributes


def _type_attributes(v: Variable) -> dict[str, str]:
    attributes = {}
    if v.unit in QUANTITIES:
        attributes["declaredType"] = QUANTITIES[v.unit]
    if v.unit:
        attributes["unit"] = v.unit
    if v.start is not None:
        attributes["start"] = _text(v)
    return attributes


def _text(v: Variable) -> str:
    assert v.start is not None
    if v.type == kinds.BOOLEAN:
        return "true" if v.start else "false"
    if v.type == kinds.INTEGER:
        return str(int(v.start))
    return repr(v.start) if math.isfinite(v.start) else {"inf": "INF", "-inf": "-INF", "nan": "NaN"}[repr(v.start)]


def _variable3(listed: Xml.Element, reference: int, v: Variable) -> None:
    Xml.SubElement(listed, TYPES[3][v.type], _common(reference, v) | _type_attributes(v))


def _variable2(listed: Xml.Element, reference: int, v: Variable) -> None:
    Xml.SubElement(
        Xml.SubElement(listed, "ScalarVariable", _common(reference, v)), TYPES[2][v.type], _type_attributes(v)
    )


def _structure(root: Xml.Element, part: ExportedPart, variables: Sequence[Variable], version: int) -> None:
    """Declare that outputs depend on inputs of the same time only if a port without delay feeds them."""
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [k for k, v in enumerate(variables, 1) if v.causality == kinds.OUTPUT]
    independent = {"dependencies": ""} if all(port.lag for port in part.inputs) else {}
    if version == 3:
        for name in ("Output", "InitialUnknown"):
            for k in outputs:
                Xml.SubElement(structure, name, {"valueReference": str(k), **independent})
        return
    for name in ("Outputs", "InitialUnknowns"):
        group = Xml.SubElement(structure, name) if outputs else structure
        for k in outputs:
            Xml.SubElement(group, "Unknown", {"index": str(k + 1), **independent})
