"""FMUs of a few lines of C, for FMI 2 and 3, for tests of what is exchanged with them.

fmu = tiny(folder, [V("u", "Float64", "input"), V("y", "Float64", "output")],
           "v->r[1][0] = 2 * v->r[0][0];")
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sources.packaging.native import compile_c
from sources.packaging.platforms import PLATFORMS, host_platform

SHELL = (Path(__file__).parent / "tiny_fmu.c").read_text(encoding="utf-8")
INNER = {"Float64": "Real", "Int32": "Integer"}
"""FMI 2's names of what FMI 3 calls otherwise."""
NONE = '""'
CAN = (
    'canGetAndSetFMUState="true" canGetAndSetFMUstate="true" '
    'canHandleVariableCommunicationStepSize="true"'
)


@dataclass(frozen=True)
class V:
    """A variable; its number in the list is its value reference.

    Attributes:
        name, type, causality: types are those of FMI 3.
        start: as in the XML.
        size: of an array of FMI 3.
        more: attributes of the variable.
        inner: attributes of the value (the same element in FMI 3).
        alias: a second name of FMI 3.
        late: an output of FMI 3 that follows inputs in initialization only.
    """

    name: str
    type: str
    causality: str
    start: str | None = None
    size: tuple[int, ...] = ()
    more: str = ""
    inner: str = ""
    alias: str = ""
    late: bool = False

    def xml(self, number: int, fmi: int) -> str:
        head = f'name="{self.name}" valueReference="{number}" causality="{self.causality}"'
        if "variability" not in self.more and self.type not in ("Float64", "Float32"):
            kind = "fixed" if self.causality == "parameter" else "discrete"
            head += f' variability="{kind}"'
        start = "" if self.start is None else f'start="{self.start}"'
        if fmi == 2:
            inner = INNER.get(self.type, self.type)
            return (
                f"<ScalarVariable {head} {self.more}><{inner} {self.inner} {start}/>"
                "</ScalarVariable>"
            )
        inside = "".join(f'<Dimension start="{n}"/>' for n in self.size)
        if self.type in ("String", "Binary") and self.start is not None:
            inside, start = inside + f'<Start value="{self.start}"/>', ""
        if self.alias:
            inside += f'<Alias name="{self.alias}"/>'
        return f"<{self.type} {head} {self.more} {self.inner} {start}>{inside}</{self.type}>"


def tiny(
    folder: Path,
    variables: Sequence[V],
    outputs: str = "",
    step: str = "",
    *,
    fmi: int = 3,
    begin: str = "",
    name: str = "m",
    definitions: str = "",
    interface: str = CAN,
) -> Path:
    """Build one; libraries are kept by their content.

    Args:
        folder: where to.
        variables: in the order of their value references.
        outputs: C statements on `Values *v`, before values are fetched.
        step: C statements on `v`, `t` and `h`; `return` of a status ends them.
        fmi: 2 or 3.
        begin: C statements on `v` at creation.
        name: of the file.
        definitions: XML before the variables.
        interface: attributes of the co-simulation interface.
    """
    sizes = [str(_size(variable)) for variable in variables]
    head = (
        f"#define FMI {fmi}\n#define SIZES {{{', '.join(sizes)}}}\n"
        f"#define OUTPUTS do {{ {outputs} }} while (0)\n#define STEP {{ {step} }}\n"
        f"#define START(values) do {{ Values *v = &(values); (void)v; {begin} }} while (0)\n"
    )
    library = compile_c({"tiny.c": head + SHELL}, "tiny.c", "m", host_platform())
    platform = PLATFORMS[host_platform()]
    place = platform.fmi2 if fmi == 2 else platform.fmi3
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _xml(variables, fmi, definitions, interface))
        archive.writestr(f"binaries/{place}/m{platform.suffix}", library)
    return path


def _size(variable: V) -> int:
    count = 1
    for item in variable.size:
        count *= item
    return count


def _xml(variables: Sequence[V], fmi: int, definitions: str, interface: str) -> str:
    version, token = ("2.0", "guid") if fmi == 2 else ("3.0", "instantiationToken")
    listed = "\n".join(v.xml(number, fmi) for number, v in enumerate(variables))
    given = [number for number, v in enumerate(variables) if v.causality == "output"]
    structure = (
        "<Outputs>" + "".join(f'<Unknown index="{n + 1}"/>' for n in given) + "</Outputs>"
        if fmi == 2
        else "".join(
            f'<Output valueReference="{n}"{" dependencies=" + NONE if variables[n].late else ""}/>'
            for n in given
        )
        + "".join(f'<InitialUnknown valueReference="{n}"/>' for n in given if variables[n].late)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="{version}" modelName="m" {token}="t">\n'
        f'<CoSimulation modelIdentifier="m" {interface}/>\n{definitions}'
        f"<ModelVariables>\n{listed}\n</ModelVariables>\n"
        f"<ModelStructure>{structure}</ModelStructure>\n</fmiModelDescription>"
    )
