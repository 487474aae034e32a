"""Writes a system as an SSP archive that other tools run.

Only what every reader of SSP 1.0 understands is used: one flat system, connectors with types,
parameter sets per component, unit conversions spelled out as linear transformations. What SSP has
no place for (communication step, algorithm, tolerance, inputs over time) goes into annotations,
which other tools skip.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..data.signals import Constant, Signal, objects
from ..errors import GraphError, InputError, UnitError
from ..files import atomic
from ..fmu.archive import Fmu
from ..fmu.values import TYPES, check_values
from ..fmu.variables import Variable
from ..spec.units import change, usual
from ..system.inputs import Driver, spread
from ..system.system import Connection, Member, System
from .document import FMU, SSC, SSD, SSV
from .read import Experiment
from .xml import Units, attributes, encode, pack, text

VERSIONS = ("1.0", "2.0")
PARAMETER_SET = "parameters"
"""Name of the parameter sets; Ecos applies one only when it is told this name."""
OMS_TOLERANCE = 1e-6
"""To which OMSimulator solves loops; its own 1e-4 would be more than the error of a usual step."""
_NAMESPACES = {
    "xmlns:ssd": SSD,
    "xmlns:ssc": SSC,
    # libcosim takes an attribute inside its annotation for an algorithm, so these stand here
    "xmlns:osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "xmlns:oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "xmlns:cosim": "cosim",
}


def write(
    system: System,
    path: Path | str,
    *,
    version: str = "1.0",
    experiment: Experiment | None = None,
    inputs: Mapping[str, Driver] | None = None,
) -> Path:
    """Write a system as an SSP archive; the same system gives the same bytes.

    Args:
        system: what to write.
        path: the .ssp file.
        version: of SSP, 1.0 or 2.0 (arrays and the types of FMI 3).
        experiment: how it is meant to be run.
        inputs: open input -> number or signal. Numbers become start values, which hold in every
            tool; signals are sampled at the communication points into a table that only cosim
            reads, others see their first value.

    Raises:
        GraphError: something that this version of SSP cannot express.
        InputError: the file cannot be written.
    """
    if version not in VERSIONS:
        raise InputError(f"SSP version {version!r}: choose {' or '.join(VERSIONS)}")
    return _Writer(system, version, experiment or Experiment(), inputs or {}).write(Path(path))


def local_starts(system: System) -> list[str]:
    """Start values that only tools set which set local variables, as FMI allows; libcosim does not.

    Returns:
        Full names of variables, neither parameters nor inputs, that start otherwise than their FMU
        says.
    """
    found = []
    for member in system.members.values():
        for key, value in member.parameters.items():
            name = f"{member.name}.{key}"
            _, variables = system.variables(name)
            starts = tuple(start for variable in variables for start in variable.start)
            if variables[0].causality in ("local", "output") and starts != tuple(
                check_values(name, variables, value)
            ):
                found.append(name)
    return found


class _Writer:
    def __init__(
        self,
        system: System,
        version: str,
        experiment: Experiment,
        inputs: Mapping[str, Driver],
    ) -> None:
        self.system, self.version, self.experiment = system, version, experiment
        self.signals: dict[str, Signal] = {}
        self.values: dict[str, dict[str, Any]] = {name: {} for name in system.members}
        self.units = Units()
        self.files: dict[str, bytes] = {}
        for member in system.members.values():
            for key, value in member.parameters.items():
                self.give(f"{member.name}.{key}", value)
        for name, signal in spread(system, inputs).items():
            self.drive(name, signal)

    # -- values ------------------------------------------------------------------------------------

    def give(self, name: str, value: Any) -> None:
        """Note a parameter or start value, element by element."""
        member, variables = self.system.variables(name)
        items = check_values(name, variables, value)
        given = self.values[member.name]
        for variable in variables:
            if variable.index is None:
                given[variable.name] = items[: variable.size]
                items = items[variable.size :]
                continue
            whole = member.description.whole(variable.name)
            if whole.name not in given and len(whole.start) != whole.size:
                raise GraphError(f"{member.name}.{whole.name} has no start values; give all of it")
            given.setdefault(whole.name, list(whole.start))[variable.index] = items[0]

    def drive(self, element: str, signal: Signal) -> None:
        """Note an input: numbers as start values, the rest as a table as well."""
        start = np.array([self.experiment.start or 0.0], dtype=np.float64)
        gain, offset = self.conversion(element, signal)
        if isinstance(signal, Constant) and (gain, offset) == (1.0, 0.0):
            self.give(element, signal.value)
            return
        if objects(signal, start):
            raise GraphError(
                f"input {element} from {signal.text} has texts, or integers that are not exact as "
                "floating-point numbers; only constant ones can be written"
            )
        self.give(element, gain * float(np.asarray(signal.at(start))[0]) + offset)
        if not isinstance(signal, Constant):
            self.signals[element] = signal

    def conversion(self, element: str, signal: Signal) -> tuple[float, float]:
        """From the unit of a signal to that of the input that it drives."""
        instance, _, variable = self.whole(element).partition(".")
        declared = self.system.members[instance].description.variables[variable]
        if not signal.unit or declared.unit is None:
            return 1.0, 0.0
        try:
            return change(signal.unit, declared.unit, difference=declared.relative)
        except UnitError as error:
            raise UnitError(f"input {element} from {signal.text}: {error}") from error

    # -- files -------------------------------------------------------------------------------------

    def write(self, path: Path) -> Path:
        sources = self.sources()
        if self.signals:
            self.files["resources/inputs.csv"] = self.table()
        components = [line for member in self.system.members.values()
                      for line in self.component(member, sources[member.name])]  # fmt: skip
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            "<ssd:SystemStructureDescription"
            + attributes(
                **_NAMESPACES, version=self.version,
                name=self.system.name, generationTool="cosim",
            ) + ">",
            "  <ssd:System"
            + attributes(name=self.system.name, description=self.system.text or None) + ">",
            "    <ssd:Elements>",
            *components,
            "    </ssd:Elements>",
            *self.connections(),
            *self.master(),
            "  </ssd:System>",
            *self.units.lines("ssd"),
            *self.default_experiment(),
            "</ssd:SystemStructureDescription>",
        ]  # fmt: skip
        self.files["SystemStructure.ssd"] = encode(lines)
        content = pack(self.files)
        with atomic(path) as temporary:
            temporary.write_bytes(content)
        return path

    def sources(self) -> dict[str, str]:
        """Instance -> name of its FMU's file; instances of the same FMU share one."""
        names: dict[str, str] = {}
        found = {}
        for member in self.system.members.values():
            fmu = member.fmu
            if fmu.digest not in names:
                names[fmu.digest] = self._free(fmu)
                self.files[names[fmu.digest]] = fmu.path.read_bytes()
            found[member.name] = names[fmu.digest]
        return found

    def _free(self, fmu: Fmu) -> str:
        stem = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_"
                       for c in fmu.path.stem)  # fmt: skip
        name = f"resources/{stem}.fmu"
        return name if name not in self.files else f"resources/{stem}-{fmu.digest[:12]}.fmu"

    def table(self) -> bytes:
        """Input signals at the communication points, rows left out in which nothing changes."""
        start, stop, step = self.experiment.start or 0.0, self.experiment.stop, self.experiment.step
        if stop is None or step is None:
            raise GraphError(
                f"input {next(iter(self.signals))} changes over time, so the experiment needs a "
                "stop time and a step"
            )
        times = start + step * np.arange(round((stop - start) / step) + 1, dtype=np.float64)
        columns = []
        for name, signal in self.signals.items():
            gain, offset = self.conversion(name, signal)
            columns.append(np.asarray(signal.at(times), dtype=np.float64) * gain + offset)
        values = np.column_stack(columns)
        kept = np.concatenate(([True], np.any(values[1:] != values[:-1], axis=1)))
        heads = [f"{name} [{self.symbol(name)}]".removesuffix(" []") for name in self.signals]
        rows = [",".join(["time [s]", *heads])]
        rows += [
            ",".join(map(repr, [time, *row]))
            for time, row in zip(times[kept].tolist(), values[kept].tolist(), strict=True)
        ]
        return ("\n".join(rows) + "\n").encode()

    def symbol(self, name: str) -> str:
        """The unit of an input if it is read as what the FMU means by it, else ""."""
        unit = self.system.declaration(name).unit
        return unit.symbol if unit is not None and usual(unit) else ""

    # -- elements ----------------------------------------------------------------------------------

    def component(self, member: Member, source: str) -> Iterable[str]:
        name = member.name
        yield "      <ssd:Component" + attributes(
            name=name, description=member.reference, type=FMU, source=source,
            implementation="CoSimulation",
        ) + ">"  # fmt: skip
        connectors = [self.connector(member, variable) for variable in self.exposed(member)]
        if connectors:
            yield "        <ssd:Connectors>"
            for lines in connectors:
                yield from lines
            yield "        </ssd:Connectors>"
        if self.values[name]:
            file = f"resources/{name}.ssv"
            self.files[file] = self.parameter_set(member)
            yield "        <ssd:ParameterBindings>"
            yield f"          <ssd:ParameterBinding{attributes(source=file)}/>"
            yield "        </ssd:ParameterBindings>"
        yield "      </ssd:Component>"

    def exposed(self, member: Member) -> list[Variable]:
        """Outputs and connected inputs; calculated parameters, texts and bytes if connected.

        Open inputs are no connectors: FMPy wires an unconnected one to whatever came before it.
        """
        found, sources = [], {wire.source for wire in self.system.connections}
        for variable in member.description.variables.values():
            causality = variable.causality
            if variable.type not in TYPES or causality not in (
                "input", "output", "calculatedParameter",
            ):  # fmt: skip
                continue
            full = [f"{member.name}.{element}" for element in variable.elements()]
            wired = any(self.system.driver(name) is not None for name in full)
            taken = not sources.isdisjoint(full)
            always = causality == "output" and variable.type not in ("String", "Binary")
            if not (always or wired or taken):
                continue
            if variable.dimensions and self.version == "1.0":
                if wired or taken:
                    raise GraphError(
                        f"{member.name}.{variable.name} is an array, which SSP 1.0 cannot connect; "
                        "write version 2.0"
                    )
                continue
            found.append(variable)
        return found

    def type(self, variable: Variable, member: Member) -> str:
        """The type of a variable in this version of SSP."""
        plain = {"Boolean2": "Boolean", "Enumeration2": "Int32", "Enumeration": "Int64"}
        name = plain.get(variable.type, variable.type)
        if self.version == "2.0" and member.description.fmi == 3:
            return name
        if name.startswith("Float"):
            return "Real"
        return "Integer" if "Int" in name else name

    def connector(self, member: Member, variable: Variable) -> list[str]:
        unit = None if variable.unit is None else self.units.name(variable.unit)
        type_ = self.type(variable, member)
        dimension = (
            [f"            <ssc:Dimension{attributes(size=variable.size)}/>"]
            if variable.dimensions
            else []
        )
        return [
            "          <ssd:Connector"
            + attributes(
                name=variable.name, kind=variable.causality, description=variable.text or None
            ) + ">",
            f"            <ssc:{type_}{attributes(unit=unit if 'Int' not in type_ else None)}/>",
            *dimension,
            "          </ssd:Connector>",
        ]  # fmt: skip

    def connections(self) -> list[str]:
        if not self.system.connections:
            return []
        lines = ["    <ssd:Connections>"]
        done: set[tuple[str, str]] = set()
        for wire in self.system.connections:
            source, target = self.whole(wire.source), self.whole(wire.target)
            if (source, target) in done:
                continue  # the rest of an array
            done.add((source, target))
            self.check_array(source, target)
            plain = (wire.gain, wire.offset) == (1.0, 0.0)
            ends = [*source.split(".", 1), *target.split(".", 1)]
            names = ("startElement", "startConnector", "endElement", "endConnector")
            head = f"      <ssd:Connection{attributes(**dict(zip(names, ends, strict=True)))}"
            units = [self.system.unit(name) for name in (wire.source, wire.target)]
            # units that say the same under two names need no care; all others are spelled out,
            # since many tools convert no units
            if plain and units[0] == units[1]:
                lines.append(head + "/>")
                continue
            lines += [head + ' suppressUnitConversion="true">', *self.transformation(wire)]
            lines.append("      </ssd:Connection>")
        return [*lines, "    </ssd:Connections>"]

    def transformation(self, wire: Connection) -> list[str]:
        instance, _, variable = self.whole(wire.target).partition(".")
        type_ = self.system.members[instance].description.variables[variable].type
        if type_.startswith("Float"):
            change = attributes(factor=wire.gain, offset=wire.offset)
            return [f"        <ssc:LinearTransformation{change}/>"]
        images = [wire.gain * value + wire.offset for value in (0.0, 1.0)]
        if not type_.startswith("Boolean") or any(image not in (0.0, 1.0) for image in images):
            raise GraphError(
                f"{wire.source} -> {wire.target}: SSP scales real numbers only, not {type_}"
            )
        entries = "".join(
            f"<ssc:MapEntry{attributes(source=bool(value), target=bool(image))}/>"
            for value, image in enumerate(images)
        )
        name = "BooleanMappingTransformation"
        return [f"        <ssc:{name}>{entries}</ssc:{name}>"]

    def whole(self, name: str) -> str:
        """The FMU's variable that a scalar element belongs to."""
        instance, _, variable = name.partition(".")
        known = self.system.members[instance].description.variables
        return f"{instance}.{variable if variable in known else variable.rpartition('[')[0]}"

    def check_array(self, source: str, target: str) -> None:
        """Raise unless two arrays are joined element by element, in order and alike."""
        starts, ends = self.system.elements(source), self.system.elements(target)
        if len(starts) == len(ends) == 1:
            return
        wires = {wire.target: wire for wire in self.system.connections}
        alike = len(starts) == len(ends) and all(
            end in wires
            and wires[end].source == start
            and (wires[end].gain, wires[end].offset) == (wires[ends[0]].gain, wires[ends[0]].offset)
            for start, end in zip(starts, ends, strict=False)
        )
        if not alike:
            raise GraphError(
                f"{source} -> {target}: SSP does not say how to count the elements of an array, so "
                "only whole arrays can be connected"
            )

    def parameter_set(self, member: Member) -> bytes:
        units, lines = Units(), []
        for name, items in self.values[member.name].items():
            variable = member.description.variables[name]
            if variable.dimensions and self.version == "1.0":
                raise GraphError(
                    f"{member.name}.{name} is an array, which SSP 1.0 cannot set; write version 2.0"
                )
            type_ = self.type(variable, member)
            if type_ == "Binary":
                raise GraphError(
                    f"{member.name}.{name} is of type Binary, whose values are not written"
                )
            if type_ in ("Real", "Float64", "Float32"):
                values = " ".join(text(float(item)) for item in items)
            elif type_ == "Boolean":
                values = " ".join(text(bool(item)) for item in items)
            elif type_ == "String":
                values = str(items[0])
            else:  # enumerations too: libcosim and Ecos stop at an item's name
                values = " ".join(text(int(item)) for item in items)
            real = type_ in ("Real", "Float64", "Float32")
            unit = units.name(variable.unit) if real and variable.unit is not None else None
            lines += [
                f"    <ssv:Parameter{attributes(name=name)}>",
                f"      <ssv:{type_}{attributes(value=values, unit=unit)}/>",
            ]
            if variable.dimensions:
                lines.append(f"      <ssc:Dimension{attributes(size=variable.size)}/>")
            lines.append("    </ssv:Parameter>")
        return encode(
            [
                '<?xml version="1.0" encoding="UTF-8"?>',
                "<ssv:ParameterSet"
                + attributes(
                    **{"xmlns:ssv": SSV, "xmlns:ssc": SSC}, version=self.version,
                    name=PARAMETER_SET, generationTool="cosim",
                ) + ">",
                "  <ssv:Parameters>",
                *lines,
                "  </ssv:Parameters>",
                *units.lines("ssv"),
                "</ssv:ParameterSet>",
            ]
        )  # fmt: skip

    def master(self) -> list[str]:
        """OMSimulator's Jacobi with our step: the element is for its library, the attributes, under
        the name that it gives the master of FMUs without one, for its Python package.
        """
        step = self.experiment.step
        if step is None:
            return []
        loops = {"relativeTolerance": OMS_TOLERANCE}
        known = attributes(name="oms_ma_default", method="oms_ma", fixedStepSize=step, **loops)
        master = attributes(description="oms-ma", stepSize=step, **loops)
        return [
            "    <ssd:Annotations>",
            '      <ssc:Annotation type="org.openmodelica">',
            f"        <oms:Annotations><oms:SimulationInformation{known}>",
            f"          <oms:FixedStepMaster{master}/>",
            "        </oms:SimulationInformation></oms:Annotations>",
            "      </ssc:Annotation>",
            "    </ssd:Annotations>",
        ]

    def options(self) -> str | None:
        """Options of the algorithm as JSON."""
        options = dict(self.experiment.options)
        try:
            return json.dumps(options, sort_keys=True, allow_nan=False) if options else None
        except (TypeError, ValueError) as error:
            raise GraphError(f"algorithm option of {options} is no JSON ({error})") from None

    def default_experiment(self) -> list[str]:
        content = self.experiment
        if content == Experiment() and not self.signals:
            return []
        head = "  <ssd:DefaultExperiment" + attributes(
            startTime=content.start, stopTime=content.stop
        )
        table = "resources/inputs.csv" if self.signals else None
        notes = []
        if content.step is not None:
            notes += [
                '      <ssc:Annotation type="com.opensimulationplatform">',
                "        <osp:Algorithm>"
                f"<osp:FixedStepAlgorithm{attributes(baseStepSize=content.step)}/></osp:Algorithm>",
                "      </ssc:Annotation>",
            ]
        run = attributes(
            step=content.step, algorithm=content.algorithm, options=self.options(),
            tolerance=content.tolerance, inputs=table,
        )  # fmt: skip
        if run:
            notes += [
                '      <ssc:Annotation type="cosim">',
                f"        <cosim:Run{run}/>",
                "      </ssc:Annotation>",
            ]
        if not notes:
            return [head + "/>"]
        return [
            head + ">", "    <ssd:Annotations>", *notes, "    </ssd:Annotations>",
            "  </ssd:DefaultExperiment>",
        ]  # fmt: skip
