"""Small good files of every kind, from which the fuzzers start."""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

from cosim.data.recording import Recording
from tests.small_fmus import T3, U, Y, fmi2, fmi3
from tests.ssp_files import binding, component, connection, connectors, real, ssd, ssm, ssv, system

TIME = np.linspace(0.0, 1.0, 11)
UNITS = (
    '<UnitDefinitions><Unit name="rad/s"><BaseUnit rad="1" s="-1" factor="1.0" offset="0.0"/>'
    '<DisplayUnit name="rpm" factor="9.55"/></Unit></UnitDefinitions>'
)
TYPES2 = (
    '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="off" value="1"/>'
    '<Item name="on" value="2"/></Enumeration></SimpleType><SimpleType name="Speed">'
    '<Real unit="rad/s" min="-100" max="100"/></SimpleType></TypeDefinitions>'
)
MANY2 = (
    U + Y
    + '<ScalarVariable name="w" valueReference="2" causality="output" variability="continuous" '
    'initial="exact"><Real declaredType="Speed" start="1.0"/></ScalarVariable>'
    '<ScalarVariable name="der(w)" valueReference="3"><Real derivative="3"/></ScalarVariable>'
    '<ScalarVariable name="mode" valueReference="4" causality="parameter" variability="fixed">'
    '<Enumeration declaredType="Mode" start="2"/></ScalarVariable>'
    '<ScalarVariable name="n" valueReference="5" causality="parameter" variability="tunable">'
    '<Integer start="3" min="0" max="9"/></ScalarVariable>'
    '<ScalarVariable name="on" valueReference="6" causality="input" variability="discrete">'
    '<Boolean start="true"/></ScalarVariable>'
    '<ScalarVariable name="text" valueReference="7" causality="parameter" variability="fixed">'
    '<String start="a"/></ScalarVariable>'
)  # fmt: skip
STRUCTURE2 = (
    '<Outputs><Unknown index="2" dependencies="1 3" dependenciesKind="dependent constant"/>'
    '<Unknown index="3" dependencies=""/></Outputs><Derivatives><Unknown index="4" '
    'dependencies="1 2"/></Derivatives><InitialUnknowns><Unknown index="2" dependencies="1"/>'
    '<Unknown index="4"/></InitialUnknowns>'
)
MANY3 = (
    T3 + '<Float64 name="u" valueReference="1" causality="input" start="1.0"/>'
    '<Float64 name="y" valueReference="2" causality="output" unit="rad/s"/>'
    '<UInt64 name="size" valueReference="3" causality="structuralParameter" start="3"/>'
    '<Float64 name="v" valueReference="4" causality="parameter" variability="tunable" '
    'start="1 2 3"><Dimension valueReference="3"/></Float64>'
    '<Int32 name="m" valueReference="5" causality="output"><Dimension start="2"/>'
    '<Dimension start="2"/></Int32><Boolean name="b" valueReference="6" causality="input" '
    'start="false"/><String name="s" valueReference="7" causality="parameter" variability="fixed">'
    '<Start value="a"/></String><Binary name="bin" valueReference="8" causality="local"/>'
    '<Enumeration name="mode" valueReference="9" declaredType="Mode" causality="parameter" '
    'variability="fixed" start="1"/><Clock name="c" valueReference="10" causality="input" '
    'intervalVariability="constant" intervalDecimal="0.1"/>'
)
TYPES3 = (
    '<TypeDefinitions><EnumerationType name="Mode"><Item name="off" value="1"/>'
    '<Item name="on" value="2"/></EnumerationType></TypeDefinitions>'
)
STRUCTURE3 = (
    '<Output valueReference="2" dependencies="1 0"/><Output valueReference="5"/>'
    '<InitialUnknown valueReference="2"/><InitialUnknown valueReference="5"/>'
)
EXPERIMENT = '<DefaultExperiment startTime="0.0" stopTime="1.0" stepSize="0.1" tolerance="1e-6"/>'
DESCRIPTION2 = fmi2(
    MANY2, STRUCTURE2, f"{UNITS}{TYPES2}{EXPERIMENT}", 'variableNamingConvention="structured"'
).encode()
DESCRIPTION3 = fmi3(MANY3, STRUCTURE3, f"{UNITS}{TYPES3}{EXPERIMENT}").encode()
METADATA = {
    "variant": "a/b", "component": "a", "fidelity": "b", "effects": ["c@d"],
    "ports": [{"name": "shaft", "effort": ["y"], "flow": ["u"], "sign": -1,
               "causality": "gives_effort"}],
    "balances": [{"name": "shaft", "kind": "rotation", "unit": "N.m"}],
    "slots": {"a": "b"}, "strengths": ["w"],
}  # fmt: skip
A = "resources/a.fmu"
SSV = ssv(
    real("u", 2.0), real("w", "3.0", "rpm"),
    '<ssv:Parameter name="n"><ssv:Integer value="2"/></ssv:Parameter>',
    '<ssv:Parameter name="on"><ssv:Boolean value="true"/></ssv:Parameter>',
    '<ssv:Parameter name="mode"><ssv:Enumeration value="on"/></ssv:Parameter>',
)  # fmt: skip
SSM = ssm(
    '<ssm:MappingEntry source="u" target="u"><ssc:LinearTransformation factor="2" offset="1"/>'
    "</ssm:MappingEntry>",
    '<ssm:MappingEntry source="w" target="w" suppressUnitConversion="true"/>',
    '<ssm:MappingEntry source="n" target="n"><ssc:IntegerMappingTransformation>'
    '<ssc:MapEntry source="2" target="3"/></ssc:IntegerMappingTransformation></ssm:MappingEntry>',
)
FILES = (
    '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/p.ssv"><ssd:ParameterMapping '
    'source="resources/p.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
)
SSD = ssd(
    system(
        component("a", A, connectors(y="output Real rad/s", u="input"), )
        + component("b", A, binding(ssv(real("u", 1.5))) + connectors(u="input Real rpm"))
        + system(component("c", A, FILES), connection(".x", "c.u"), connection("c.y", ".z"),
                 inner=connectors(x="input Real rad/s", z="output"), name="box"),
        connection("a.y", "b.u",
                   '<ssc:LinearTransformation factor="2" offset="0"/>'),
        connection("a.w", "box.x"), connection(".root", "a.u"),
        inner=connectors(root="input") + binding(ssv(real("box.c.w", 2.0))),
    ),
    '<ssd:DefaultExperiment startTime="0" stopTime="1"><ssd:Annotations/></ssd:DefaultExperiment>',
)  # fmt: skip
DRIVEN = SSD.replace(
    "<ssd:Annotations/>",
    '<ssd:Annotations><ssc:Annotation type="cosim"><c:Run xmlns:c="cosim" step="0.1" '
    'inputs="resources/inputs.csv"/></ssc:Annotation></ssd:Annotations>',
)
INPUTS = "time [s],a.u [rad/s],b.w\n0.0,1.0,2.0\n0.1,1.5,2.0\n0.2,2.0,2.0\n"
SYSTEM = """name = "pair"
description = "two"

[instances]
a = "a.fmu"
b = "a.fmu"

[parameters]
a.n = 2
"b.u" = 1.5
b.mode = 2

connections_ = 1
"""
SYSTEM = SYSTEM.replace("\nconnections_ = 1\n", "").replace(
    "[instances]", 'connections = ["a.y -> b.u"]\n\n[instances]'
)
SCENARIO = """description = "a run"
question = "q"
system = "system.toml"
duration = 1.0
start = 0.0
step = 0.1
algorithm = "jacobi"
tolerance = 1e-6
options = { extrapolation = 1 }
plot = ["a.y"]

[variants]
a = "a.fmu"

[parameters]
a.n = 2

[inputs]
"a.u" = { file = "log.csv", column = "u", unit = "rad/s", interpolation = "linear" }
"b.w" = { times = [0.0, 1.0], values = [1.0, 2.0] }
"a.on" = 1

[record]
signals = ["a.y", "b.y"]
period = 0.1

[compare.y]
signal = "a.y"
file = "log.csv"
column = "y"
scale = 1.0
offset = 0.0

[compare.path]
signals = ["a.y", "b.y"]
circle = { start = [0.0, 1.0], centre = [0.0, 0.0], rate = 1.0 }

[[checks]]
name = "small"
source = "s"
of = "rms"
comparison = "y"
limit = 0.1

[[checks]]
name = "final"
of = "final"
signal = "a.y"
limit = [0.0, 1.0]
expected = 1.0
after = 0.5

[[plots]]
label = "y"
signals = ["a.y"]
unit = "rad/s"

[runs.one]
duration = 2.0
parameters = { "a.n" = 3 }

[runs.two]
step = 0.05
"""
TABLE = """system = "system.toml"
duration = "{T}"
step = 0.1
description = "{name}"

[table]
file = "table.csv"
join = { file = "other.csv", on = "set" }
name = "SET{set}"
columns.turn = "2 * pi / rate + sqrt(others(rate, of))"

[parameters]
"a.u" = "{turn}"
"""
STUDY = """description = "a study"
scenario = ["motor_bench"]
runs = ["ST1"]
duration = 1.0
period = 0.1
step = [1e-3, 2e-3]
algorithm = ["jacobi", { name = "jacobi", extrapolation = 1 }]
combine = "grid"
keep = ["load.w"]
signals = "load.w"
repeats = 2
reuse = true

[set]
gearbox = ["", "elastic"]

[param]
"load.J" = { from = 0.1, to = 1.0, count = 5, scale = "log" }
gearbox.eta = { uniform = [0.5, 0.9] }
gearbox.b = { normal = [0.1, 0.01], minimum = 0.0 }

[sample]
count = 10
method = "random"
seed = 7

[reference]
step = "finest"
algorithm = "jacobi"
"""
SET = """set = "s"
rig = "bench"
sheet = "rig.toml"

[[run]]
name = "r0"
file = "log.csv"
purpose = "identification"
start = [0.0, 1.0]

[[run]]
name = "r1"
file = "log.csv"
purpose = "validation"
"""
MAPPING = """description = "a mapping"
rig = "bench"
system = "system.toml"
step = 0.05
algorithm = "gauss_seidel"
options = { extrapolation = 1 }
period = 0.1
tick = 0.05
search_step = 0.1
time = "time"
gap = 0.3
lead = 0.1
relative = []

[search]
options = { extrapolation = 2 }
parameters = { "a.n" = 3 }

[parameters]
a.n = 2

[starts]
begin = "b.n"

[inputs]
"a.u" = { column = "u", gain = 0.5, interpolation = "linear", unit = "V" }
"a.on" = "flag"

[columns]
flag = { source = "u", scale = 0.0, offset = 1.0, unit = "1" }
turn = { source = "y", time = "time", late = 0.01, unwrap = true, gap = 0.2, limit = 9.0 }

[channels]
y = { signal = "a.y", sigma = 0.1, quantum = 0.01, roundings = 2 }
turn = { signal = "b.y", sigma = 0.1, transform = "mean", window = 0.1, shift = 0.05 }
other = { signal = "a.w", column = "nowhere", sigma = 1.0, optional = true }

[[parameter]]
name = "n"
unit = ""
nominal = 3
min = 0
max = 9
prior = 1.0
targets = { "a.n" = 1.0 }

[[nuisance]]
name = "first"
nominal = "first:y"
span = 2.0
per_run = true
targets = ["b.u"]

[[run]]
name = "r0"
file = "log.csv"
purpose = "identification"
begin = 2
samples = [1, 11]

[[run]]
name = "r1"
file = "log.csv"
purpose = "validation"
begin = 3
window = 0.5

[checks]
allow = ["spikes"]
"""
SHEET = '[[signal]]\nname = "u"\nunit = "V"\nnoise_sigma = 0.1\n'
CSV = "time [s],u [V],y,word\n" + "".join(
    f"{t:.1f},{t * t},{'' if t > 0.9 else t},a\n" for t in TIME.tolist()
)


def _bytes(write: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x"
        write(path)
        return path.read_bytes()


@lru_cache(maxsize=None)
def parquet() -> bytes:
    table = pa.table(
        {"time": TIME, "u": TIME.astype(np.float32), "n": np.arange(11), "s": ["a"] * 11}
    )
    return _bytes(lambda path: pq.write_table(table, path))


@lru_cache(maxsize=None)
def recording() -> bytes:
    values = np.column_stack([TIME, TIME**2])
    whole = Recording(TIME, values, ("a.x", "a.y"), {"a.x": "m"}, {"system": "s"}, {"b": 1.0})
    return _bytes(whole.write_parquet)


ARRAYS: dict[str, Any] = {
    "time": TIME, "n": np.arange(3, dtype=np.int16), "xy": np.arange(6.0).reshape(3, 2),
    "on": np.array([True, False]), "word": np.array(["a", "b"]),
}  # fmt: skip


@lru_cache(maxsize=None)
def npz(packed: bool) -> bytes:
    buffer = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(buffer, **ARRAYS)
    return buffer.getvalue()


@lru_cache(maxsize=None)
def matlab(kind: str) -> bytes:
    buffer = io.BytesIO()
    content = {**{k: v for k, v in ARRAYS.items() if k != "word"}, "t": "text"}
    if kind == "4":
        content = {"time": TIME, "xy": ARRAYS["xy"], "t": "text"}
        savemat(buffer, content, format="4")
    else:
        savemat(buffer, {**content, "s": {"a": 1.0}, "c": np.array([1j])},
                do_compression=kind == "7")  # fmt: skip
    return buffer.getvalue()


def archive(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as opened:
        for name, content in files.items():
            opened.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


@lru_cache(maxsize=None)
def fmu(version: int) -> bytes:
    folder = "linux64" if version == 2 else "x86_64-linux"
    return archive({
        "modelDescription.xml": DESCRIPTION2 if version == 2 else DESCRIPTION3,
        f"binaries/{folder}/m.so": b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\x00\x3e\x00",
        "extra/cosim/component.json": json.dumps(METADATA).encode(), "resources/a": b"a",
    })  # fmt: skip


def result(content: Any, key: str = "k") -> bytes:
    """A result file of a study with a checksum that fits."""
    text = json.dumps(content, sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return (
        f'{{"format": "cosim study result", "sha256": "{digest}",\n"result": {text}}}\n'
    ).encode("utf-8", "replace")


RESULT = {
    "key": "k", "scenario": "s", "point": {"step": 0.1}, "channels": None, "comparison": {},
    "wall_s": 0.1,
}  # fmt: skip
