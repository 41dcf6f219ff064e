"""``modelDescription.xml`` of FMI 2.0 and 3.0, and ``sources/buildDescription.xml`` of 3.0."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isinf
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from boom_model.fmu.source import TOLERANCE
from boom_model.fmu.units import add_units, shown
from boom_model.fmu.variables import FmuVariable

SOURCE = "boom.c"
"""The source file."""
STEP, STOP = 0.01, 60.0
"""s. What an importer proposes."""


@dataclass(frozen=True)
class FmuTitle:
    """What the description says of the whole: name of the machine, a sentence, version of the program."""

    name: str
    meaning: str
    version: str

    @property
    def identifier(self) -> str:
        """Of the model in C: the library is called so."""
        return "boom_" + re.sub(r"\W", "_", self.name, flags=re.ASCII)


def description(about: FmuTitle, rows: list[FmuVariable], version: int, token: str) -> bytes:
    """The model description of FMI ``version`` 2 or 3."""
    root = Element("fmiModelDescription", fmiVersion="3.0" if version == 3 else "2.0", modelName=about.name)
    root.set("instantiationToken" if version == 3 else "guid", token)
    root.set("description", about.meaning)
    root.set("generationTool", f"boom {about.version}")
    root.set("variableNamingConvention", "structured")
    kind = SubElement(
        root, "CoSimulation", modelIdentifier=about.identifier, canHandleVariableCommunicationStepSize="true"
    )
    if version == 3:
        kind.set("canGetAndSetFMUState", "true")
    else:
        kind.set("canGetAndSetFMUstate", "true")
        kind.set("canNotUseMemoryManagementFunctions", "true")
        SubElement(SubElement(kind, "SourceFiles"), "File", name=SOURCE)
    add_units(root, (row.unit for row in rows))
    log = SubElement(root, "LogCategories")
    SubElement(log, "Category", name="logStatusError", description="what was refused, and why")
    SubElement(
        root, "DefaultExperiment", startTime="0", stopTime=f"{STOP:g}", tolerance=f"{TOLERANCE:g}", stepSize=f"{STEP:g}"
    )
    listed = SubElement(root, "ModelVariables")
    for reference, row in enumerate(rows):
        _variable(listed, reference, row, version)
    structure = SubElement(root, "ModelStructure")
    outputs = [reference for reference, row in enumerate(rows) if row.causality == "output"]
    if version == 3:
        for element in ("Output", "InitialUnknown"):
            for reference in outputs:
                SubElement(structure, element, valueReference=str(reference))
    else:
        for element in ("Outputs", "InitialUnknowns"):
            unknowns = SubElement(structure, element)
            for reference in outputs:
                SubElement(unknowns, "Unknown", index=str(reference + 1))
    return _text(root)


def build_description(about: FmuTitle) -> bytes:
    """How the library is built from its source (FMI 3.0)."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=about.identifier)
    SubElement(SubElement(configuration, "SourceFileSet", language="C11"), "SourceFile", name=SOURCE)
    SubElement(configuration, "Library", name="m")
    return _text(root)


def _variable(parent: Element, reference: int, row: FmuVariable, version: int) -> None:
    attributes = {"name": row.name, "valueReference": str(reference), "causality": row.causality}
    attributes |= {"variability": row.variability, "description": row.meaning}
    own = {} if row.boolean else _number(row)
    if row.start is not None:
        own["start"] = ("true" if row.start else "false") if row.boolean else repr(float(row.start))
    if version == 3:
        SubElement(parent, "Boolean" if row.boolean else "Float64", attributes | own)
    else:
        element = SubElement(parent, "ScalarVariable", attributes)
        SubElement(element, "Boolean" if row.boolean else "Real", own)


def _number(row: FmuVariable) -> dict[str, str]:
    """Unit, limits and size of a number."""
    own: dict[str, str] = {}
    if row.unit != "-":
        own["unit"] = row.unit
        if shown(row.unit):
            own["displayUnit"] = shown(row.unit)
    own |= {key: repr(float(v)) for key, v in (("min", row.minimum), ("max", row.maximum)) if not isinf(v)}
    if row.nominal is not None:
        own["nominal"] = repr(float(row.nominal))
    return own


def _text(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
