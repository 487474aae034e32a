"""One entry per reader: good files, how they are changed, and the public door they go through."""

from __future__ import annotations

import io
import json
import random
import shutil
import struct
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cosim import ssp
from cosim.calibrate import read_problem
from cosim.calibrate.checks.examine import check_data
from cosim.data.logs import read_data_set, read_log
from cosim.data.recording import read_recording
from cosim.fmu.archive import open_fmu
from cosim.fmu.check import check
from cosim.fmu.description import parse_description
from cosim.fmu.metadata import parse_metadata
from cosim.scenario.scenario import read_scenario
from cosim.study.definition import read_study
from cosim.study.store import Store
from cosim.system.provider import FolderProvider
from cosim.system.toml import read_system

from . import bags, seeds
from .mutate import (
    JSON_VALUES,
    NUMBERS,
    TEXTS,
    Mutation,
    repeated,
    some_bytes,
    some_json,
    some_text,
    some_toml,
    some_xml,
)


@dataclass(frozen=True)
class Reader:
    """A reader under test.

    Attributes:
        name: on the command line.
        file: name of the changed file, in a folder of its own.
        seeds: good contents of it.
        mutate: makes another content of one.
        read: the public door; takes the folder and the file.
        beside: other files of the folder, unchanged.
    """

    name: str
    file: str
    seeds: Callable[[], Sequence[bytes]]
    mutate: Mutation
    read: Callable[[Path], Any]
    beside: Callable[[], dict[str, bytes]] = field(default=dict)

    def content(self, seed: int, number: int) -> bytes:
        """Input `number` of a seed; the first ones are the good files."""
        good = self.seeds()
        if number < len(good):
            return good[number]
        chance = random.Random(f"{seed}/{self.name}/{number}")
        return self.mutate(chance, chance.choice(good))

    def place(self, folder: Path, content: bytes) -> Path:
        """Write an input and what lies beside it."""
        for name, beside in self.beside().items():
            target = folder / name
            if not target.is_file():
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(beside)
        path = folder / self.file
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            shutil.rmtree(path)
        path.write_bytes(content)
        return path


# -- mutations of containers -----------------------------------------------------------------------


def _of_archive(inside: Callable[[str], Mutation]) -> Mutation:
    """Change a zip archive: the content, name or flags of an entry, or its bytes as a whole."""

    def mutate(chance: random.Random, content: bytes) -> bytes:
        if chance.random() < 0.25:
            return some_bytes(chance, content)
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = [(info.filename, archive.read(info)) for info in archive.infolist()]
        place = chance.randrange(len(files))
        name, inner = files[place]
        kind = chance.randrange(10)
        if kind < 6:
            files[place] = (name, inside(name)(chance, inner))
        elif kind == 6:
            files[place] = (chance.choice((*TEXTS, f"{name}/x", name.upper(), f"./{name}")), inner)
        elif kind == 7:
            files.append((chance.choice([n for n, _ in files]), inner))
        elif kind == 8:
            del files[place]
        else:
            files.append((chance.choice(TEXTS) + "x", bytes(chance.choice((0, 10, 10**6)))))
        buffer = io.BytesIO()
        with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w") as archive:
            warnings.simplefilter("ignore")  # names that are there twice are meant
            for number, (each, one) in enumerate(files):
                info = zipfile.ZipInfo(each.encode("utf-8", "replace").decode() or "x")
                if number == place and chance.random() < 0.1:
                    info.external_attr = chance.choice((0xA1FF, 0x41FF, 0x61FF)) << 16
                method = chance.choice((0, 8, 8, 8, 12, 14))
                archive.writestr(info, one, method)
        return buffer.getvalue()

    return mutate


def _inside_fmu(name: str) -> Mutation:
    if name.endswith(".xml"):
        return repeated(some_xml, (some_bytes, some_text))
    return repeated(some_json) if name.endswith(".json") else some_bytes


def _npy(chance: random.Random, content: bytes) -> bytes:
    """Change an array: its header, as text, or any byte."""
    if chance.random() < 0.4:
        return some_bytes(chance, content)
    head = content[10:74]
    shape = chance.choice((
        b"(3,)", b"(-1,)", b"(3, 3)", b"()", b"(0,)", b"(10**9,)", b"(4000000000,)", b"5", b"None",
        b"(1.5,)", b"('a',)", b"(True,)", b"((1,),)", b"(" + b"(" * 90,
    ))  # fmt: skip
    dtype = chance.choice((
        b"'<f8'", b"'|O'", b"'<M8[s]'", b"'>i4'", b"'|V8'", b"'<U3'", b"[('a', '<f8')]", b"'x'",
        b"None", b"5", b"'|S0'", b"'<f16'", b"'|b1'", b"[('a', '|O')]", b"('<f8', (2,))", b"'<c16'",
    ))  # fmt: skip
    order = chance.choice((b"False", b"True", b"1", b"None"))
    head = b"{'descr': " + dtype + b", 'fortran_order': " + order + b", 'shape': " + shape + b", }"
    if chance.random() < 0.2:
        head = some_bytes(chance, head)
    head = head.ljust(117) + b"\n"
    version = chance.choice((b"\x01\x00", b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x00"))
    length = struct.pack("<H" if version[0] == 1 else "<I", len(head))
    return b"\x93NUMPY" + version + length + head + content[128:]


def _matlab(chance: random.Random, content: bytes) -> bytes:
    """Change bytes, within packed variables, too."""
    if content[126:128] != b"IM" or chance.random() < 0.4:
        return some_bytes(chance, content)
    parts, place = [content[:128]], 128
    while place + 8 <= len(content):
        kind, size = struct.unpack_from("<II", content, place)
        parts.append(content[place : place + 8 + size])
        place += 8 + size
    chosen = chance.randrange(1, len(parts))
    kind, size = struct.unpack_from("<II", parts[chosen])
    inner = parts[chosen][8:]
    if kind == 15:
        inner = zlib.compress(some_bytes(chance, zlib.decompress(inner)))
    else:
        inner = some_bytes(chance, inner)
    parts[chosen] = struct.pack("<II", kind, len(inner)) + inner
    return b"".join(parts)


def _parquet(chance: random.Random, content: bytes) -> bytes:
    """Another schema, other metadata, or bytes."""
    if chance.random() < 0.6:
        return some_bytes(chance, content)
    table = pq.read_table(io.BytesIO(content))
    kind = chance.randrange(4)
    if kind == 0:
        meta = {**(table.schema.metadata or {})}
        meta[b"cosim"] = some_json(chance, meta.get(b"cosim", b"{}"))
        if chance.random() < 0.2:
            meta[b"cosim"] = json.dumps(chance.choice(JSON_VALUES)).encode()
        table = table.replace_schema_metadata(meta)
    elif kind == 1:
        arrays = chance.choice((
            pa.array(["a"] * len(table)), pa.array([None] * len(table), pa.float64()),
            pa.array([[1.0]] * len(table)), pa.array([True] * len(table)), pa.nulls(len(table)),
            pa.array([10**18] * len(table)), pa.array([np.float16(1)] * len(table), pa.float16()),
            pa.array([{"a": 1}] * len(table)), pa.array([b"a"] * len(table)),
            pa.array([0] * len(table), pa.timestamp("ns")),
        ))  # fmt: skip
        name = chance.choice((*table.column_names, "new", ""))
        if name in table.column_names:
            table = table.set_column(table.column_names.index(name), name, arrays)
        else:
            table = table.append_column(name, arrays)
    elif kind == 2:
        names = [
            name if chance.random() < 0.7 else chance.choice((*TEXTS[:12], *table.column_names))
            for name in table.column_names
        ]
        table = table.rename_columns(names)
    else:
        table = table.slice(0, chance.choice((0, 1, 5)))
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression=chance.choice(("none", "snappy", "gzip", "zstd")))
    return buffer.getvalue()


def _csv(chance: random.Random, content: bytes) -> bytes:
    """Cells, separators, encodings."""
    text = content.decode("utf-8", "replace")
    kind = chance.randrange(6)
    if kind == 0:
        return text.replace(",", chance.choice((";", "\t", "|", ",,", "\0"))).encode()
    if kind == 1:
        return text.encode(chance.choice(("utf-16", "utf-8-sig", "utf-32", "cp500")))
    if kind == 2:
        cell = chance.choice((*NUMBERS, *TEXTS, "N/A", "nan", "-", "1;2", '"a', '"a""b"', "1e5000"))
        rows = text.split("\n")
        place = chance.randrange(len(rows))
        cells = rows[place].split(",")
        cells[chance.randrange(len(cells))] = cell
        rows[place] = ",".join(cells)
        return "\n".join(rows).encode("utf-8", "replace")
    if kind == 3:
        return text.replace("\n", chance.choice(("\r", "\r\n", "\n\n", "\x0b", "\x85"))).encode()
    return some_text(chance, content) if kind == 4 else some_bytes(chance, content)


def _result(chance: random.Random, content: bytes) -> bytes:
    """Another result, mostly with a checksum that fits."""
    if chance.random() < 0.3:
        return repeated(some_json)(chance, content)
    inner = some_json(chance, json.dumps(seeds.RESULT).encode())
    return seeds.result(json.loads(inner))


# -- doors -----------------------------------------------------------------------------------------


def _description(path: Path) -> None:
    parse_description(path.read_bytes(), seeds.METADATA, str(path))


def _metadata(path: Path) -> None:
    content = parse_metadata(path.read_bytes(), str(path))
    parse_description(seeds.DESCRIPTION2, content, str(path))


def _fmu(path: Path) -> None:
    check(path)
    open_fmu(path).platforms()


def _checked(path: Path) -> None:
    for finding in check(path):
        assert str(finding) and finding.text and finding.way_out
        json.dumps(finding.to_dict())


def _package(path: Path) -> None:
    ssp.read_package(path if path.suffix == ".ssp" else path.parent)


def _resource(path: Path) -> None:
    ssp.read_package(path.parent.parent)


def _scenario(path: Path) -> None:
    file = read_scenario(path)
    for run in list(file.runs)[:20]:
        file.scenario(run)


def _system(path: Path) -> None:
    read_system(path).build(None)


def _set(path: Path) -> None:
    data = read_data_set(path.parent)
    for run in data.runs:
        data.log(run)


def _mapping(path: Path) -> None:
    problem = read_problem(path.parent, FolderProvider(path.parent), mapping=path)
    check_data(problem)


def _store(path: Path) -> None:
    store = Store(path.parent, lambda text: None)
    if store.read(path.stem) is not None and store.channels(path.stem).is_file():
        store.recording(path.stem)
    shutil.rmtree(path.parent)
    path.parent.mkdir()


def _ssp(path: str) -> dict[str, bytes]:
    files = {
        "SystemStructure.ssd": seeds.SSD.encode(), seeds.A: seeds.fmu(2),
        "resources/p.ssv": seeds.SSV.encode(), "resources/p.ssm": seeds.SSM.encode(),
    }  # fmt: skip
    return {name: content for name, content in files.items() if name != path}


def _scenario_files() -> dict[str, bytes]:
    return {
        "system.toml": seeds.SYSTEM.encode(), "log.csv": seeds.CSV.encode(),
        "table.csv": b"set,rate,T,of\n1,0.5,1.0,a\n2,0.25,2.0,a\n", "a.fmu": seeds.fmu(2),
        "other.csv": b"set,name\n1,a\n2,b\n3,c\n",
    }  # fmt: skip


XML = repeated(some_xml, (some_bytes, some_text))
TOML = repeated(some_toml, (some_bytes, some_text))
READERS = {
    reader.name: reader
    for reader in (
        Reader("fmi2", "modelDescription.xml", lambda: [seeds.DESCRIPTION2], XML, _description),
        Reader("fmi3", "modelDescription.xml", lambda: [seeds.DESCRIPTION3], XML, _description),
        Reader(
            "component", "component.json", lambda: [json.dumps(seeds.METADATA).encode()],
            repeated(some_json), _metadata,
        ),
        Reader(
            "archive", "x.fmu", lambda: [seeds.fmu(2), seeds.fmu(3)], _of_archive(_inside_fmu),
            _fmu,
        ),
        Reader(
            "check", "x.fmu", lambda: [seeds.fmu(2), seeds.fmu(3)],
            _of_archive(lambda name: XML if name.endswith(".xml") else _inside_fmu(name)), _checked,
        ),
        Reader(
            "ssp", "x.ssp", lambda: [seeds.archive(_ssp(""))],
            _of_archive(lambda name: XML if name[-4:] != ".fmu" else some_bytes), _package,
        ),
        Reader(
            "ssd", "SystemStructure.ssd", lambda: [seeds.SSD.encode()], XML, _package,
            lambda: _ssp("SystemStructure.ssd"),
        ),
        Reader(
            "ssv", "resources/p.ssv", lambda: [seeds.SSV.encode()], XML, _resource,
            lambda: _ssp("resources/p.ssv"),
        ),
        Reader(
            "ssm", "resources/p.ssm", lambda: [seeds.SSM.encode()], XML, _resource,
            lambda: _ssp("resources/p.ssm"),
        ),
        Reader(
            "inputs", "resources/inputs.csv", lambda: [seeds.INPUTS.encode()], _csv, _resource,
            lambda: {**_ssp(""), "SystemStructure.ssd": seeds.DRIVEN.encode()},
        ),
        Reader(
            "scenario", "scenario.toml", lambda: [seeds.SCENARIO.encode(), seeds.TABLE.encode()],
            TOML, _scenario, _scenario_files,
        ),
        Reader(
            "system", "x.toml", lambda: [seeds.SYSTEM.encode()], TOML, _system,
            lambda: {"a.fmu": seeds.fmu(2)},
        ),
        Reader("study", "study.toml", lambda: [seeds.STUDY.encode()], TOML, read_study),
        Reader(
            "set", "set.toml", lambda: [seeds.SET.encode()], TOML, _set,
            lambda: {"log.csv": seeds.CSV.encode(), "rig.toml": seeds.SHEET.encode()},
        ),
        Reader(
            "mapping", "dataset.toml", lambda: [seeds.MAPPING.encode()], TOML, _mapping,
            lambda: {
                "system.toml": seeds.SYSTEM.encode(), "log.csv": seeds.CSV.encode(),
                "a.fmu": seeds.fmu(2),
            },
        ),
        Reader("csv", "x.csv", lambda: [seeds.CSV.encode()], _csv, read_log),
        Reader("parquet", "x.parquet", lambda: [seeds.parquet()], _parquet, read_log),
        Reader(
            "npz", "x.npz", lambda: [seeds.npz(False), seeds.npz(True)],
            _of_archive(lambda name: _npy), read_log,
        ),
        Reader(
            "mat", "x.mat", lambda: [seeds.matlab(kind) for kind in ("4", "6", "7")], _matlab,
            read_log,
        ),
        Reader("recording", "x.parquet", lambda: [seeds.recording()], _parquet, read_recording),
        Reader("store", "runs/k.json", lambda: [seeds.result(seeds.RESULT)], _result, _store),
        Reader("inspect", "x.csv", lambda: [seeds.CSV.encode()], _csv, bags.inspected),
        *(
            Reader("mcap", "x.mcap", lambda: [bags.bag("MCAP")], some_bytes, bags.inspected),
            Reader("db3", "x.db3", lambda: [bags.bag("SQLITE3")], some_bytes, bags.inspected),
            Reader("bag", "x.bag", lambda: [bags.bag1()], some_bytes, bags.inspected),
        )[: 3 * bags.THERE],
    )
}  # fmt: skip


def temporary() -> tempfile.TemporaryDirectory[str]:
    """A folder for inputs, caches and everything that a reader may write."""
    return tempfile.TemporaryDirectory(prefix="cosim-fuzz-", ignore_cleanup_errors=True)
