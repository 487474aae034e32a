"""An installed wheel: no checkout around, `cosim_library` instead of `sources` and `scenarios`."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.errors import CosimError, VariantError
from cosim.installation.builder import default_provider
from cosim.installation.library import CATALOGUE, Library
from sources.distribution import contents
from sources.distribution.contents import sorted_out
from sources.distribution.make import make, write_pack
from tests.fmus import fmu

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUN = ["run", "motor_bench/ST1", "--step", "1e-3", "--duration", "0.05", "--json"]
PLAIN = ["dc_motor.lab_bench/sampled", "gearbox.lab_bench/ratio", "inertia.lab_bench/disc",
         "encoder.motor_bench/counts", "gearbox/ratio"]  # fmt: skip
MAPPING = ROOT / "scenarios" / "robotino_omni" / "dataset.toml"
"""Its system has few candidates."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a small wheel carries."""
    folder = tmp_path_factory.mktemp("made")
    make(folder, mappings=[MAPPING], plain=PLAIN)
    return folder


def test_nothing_enters_at_a_mass_centre() -> None:
    """A wheel of everything must not stop there: 5 of 2095 variants are such."""
    load, body = (f"crawler.lab/track_contact+unknown_input@{at}" for at in ("load", "body"))
    assert sorted_out([load, body]) == ([body], [load])


def test_a_wheel_serves_who_begins_with_a_template() -> None:
    problems = {item.name: item for item in contents.of_templates(default_provider())}
    assert {"diff_drive", "tricycle", "mecanum", "omni", "tracked", "motor"} < set(problems)
    asked = contents.of_diagnosis(problems["diff_drive"])
    assert "diff_drive/rolling+unknown_input@turn" in asked
    assert sorted_out(asked) == (asked, [])


def test_a_wheel_serves_a_motor_on_a_logged_voltage() -> None:
    asked = contents.of_diagnosis(contents.geared_motor(default_provider()))
    assert "inertia/disc+coulomb@flange" in asked
    assert not any(name.startswith("inertia.") for name in asked)


def test_a_wheel_serves_rigs_but_no_public_logs() -> None:
    """Nor logs that are made for estimation."""
    served = {path.parent.name for path in contents.searched()}
    assert served == {
        "motor_bench", "crawler_bench", "mobile_manipulator_bench", "omni_bench"
    }  # fmt: skip


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as a wheel without FMUs fills it."""
    folder = tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns("__pycache__", "*.fmu")
    shutil.copytree(ROOT / "cosim", folder / "cosim", ignore=ignored)
    for name in ("sources", "scenarios"):
        shutil.copytree(ROOT / name, folder / "cosim_library" / name, ignore=ignored)
    shutil.copy(ROOT / "LICENSE", folder / "cosim_library")
    return folder


@pytest.fixture(scope="module")
def site(bare: Path, made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with FMUs."""
    folder = tmp_path_factory.mktemp("full") / "site"
    shutil.copytree(bare, folder)
    shutil.copytree(made / "kernel", folder / "cosim" / "master" / "kernel" / "lib")
    shutil.copytree(made / "packs", folder / "cosim_library" / "packs")
    shutil.copy(made / CATALOGUE, folder / "cosim_library")
    return folder


def call(site: Path, work: Path, *arguments: str, blocked: str = "") -> tuple[int, str, str]:
    program = f"import sys\nsys.path.insert(0, {str(site)!r})\n"
    if blocked:
        program += f"sys.modules[{blocked!r}] = None\n"
    program += f"sys.argv = ['cosim', *{list(arguments)!r}]\nfrom cosim.cli import main\nmain()\n"
    cache = {"COSIM_CACHE": str(work / "cache")} if blocked else {}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=work, capture_output=True, text=True,
        env={**os.environ, **cache},
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def test_a_wheel_without_fmus_builds_what_is_missing(bare: Path, tmp_path: Path) -> None:
    code, out, err = call(bare, tmp_path, *RUN)
    assert code == 0, err
    assert json.loads(out)["scenario"] == "motor_bench/ST1"
    assert (tmp_path / "out" / "motor_bench" / "ST1" / "result.json").is_file()
    assert not (bare / "sources").exists()
    code, out, err = call(bare, tmp_path, *RUN, blocked="casadi")
    assert code == 2 and out == ""
    assert "building FMUs needs casadi, which is not installed: pip install 'cosim-rob" in err


def test_its_fmus_run_without_casadi_by_the_compiled_executor(site: Path, tmp_path: Path) -> None:
    files = sorted(path for path in site.rglob("*") if path.suffix != ".pyc")
    code, out, err = call(site, tmp_path, *RUN, blocked="casadi")
    assert code == 0, err
    assert json.loads(out)["fmu_steps"] == 200
    recording = tmp_path / "out" / "motor_bench" / "ST1" / "ST1" / "recording.parquet"
    assert recording.is_file() or list(tmp_path.rglob("recording.parquet"))
    assert (site / "cosim" / "master" / "kernel" / "lib").is_dir()
    assert not (tmp_path / "cache" / "kernel").exists()
    assert sorted(path for path in site.rglob("*") if path.suffix != ".pyc") == files


def test_its_catalogue_is_listed_and_copied_without_casadi(site: Path, tmp_path: Path) -> None:
    code, out, err = call(site, tmp_path, "fmus", "list", "--json", blocked="casadi")
    assert code == 0, err
    listed = {entry["variant"]: entry for entry in json.loads(out)}
    assert set(PLAIN) < set(listed)
    assert "tau_a" in {item["name"] for item in listed["gearbox.lab_bench/ratio"]["inputs"]}
    built = ["fmus", "build", "gearbox.lab_bench/ratio", "--fmi", "3", "--out", "copied"]
    code, out, err = call(site, tmp_path, *built, blocked="casadi")
    assert code == 0, err
    copied = tmp_path / "copied" / "fmi3" / "gearbox.lab_bench-ratio.fmu"
    assert copied.read_bytes() == fmu("gearbox.lab_bench/ratio", fmi=3).read_bytes()


def test_what_a_diagnosis_asks_is_known_without_casadi(site: Path, tmp_path: Path) -> None:
    """Which effects fit, contain others, read what; which fidelities a variant is the limit of."""
    asked = (
        "from cosim.installation.builder import default_provider\n"
        "provider, name = default_provider(), 'gearbox.lab_bench/ratio'\n"
        "effects = sorted({effect for effect, _, _ in provider.candidates(name)})\n"
        "contained = {effect: provider.contained(effect) for effect in effects}\n"
        "needs = {effect: provider.needs(effect) for effect in effects}\n"
        "found = [provider.candidates(name), contained, needs, provider.refinements(name)]\n"
        "print(json.dumps(found))\n"
    )
    program = f"import json, sys\nsys.path.insert(0, {str(site)!r})\n"
    answers = []
    for blocked, at in (("casadi", tmp_path), ("", ROOT)):
        head = program + f"sys.modules[{blocked!r}] = None\n" if blocked else "import json\n"
        done = subprocess.run([sys.executable, "-c", head + asked], cwd=at, text=True, check=True,
                              capture_output=True)  # fmt: skip
        answers.append(json.loads(done.stdout))
    assert answers[0] == answers[1]
    assert any(answers[0][1].values()) and any(answers[0][2].values())


def test_a_system_is_composed_without_casadi(site: Path, tmp_path: Path) -> None:
    """A component alone stands for its simplest fidelity, which the wheel's catalogue knows."""
    code, _, err = call(
        site, tmp_path, "new", "system", "own", "--from", "gearbox", blocked="casadi"
    )
    assert code == 0, err
    assert 'gearbox = "gearbox/ratio"' in (tmp_path / "own" / "system.toml").read_text()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("gearbox=lossy", "gearbox.lab_bench/lossy is not among the FMUs of this installation, "
         "and building FMUs needs casadi, which is not installed: pip install 'cosim-robotics[b"),
        ("gearbox=losy", "no fidelity of 'gearbox' called 'losy'; did you mean 'lossy'"),
        ("load=+coulom", "no effect 'coulom'; did you mean 'coulomb'"),
        ("gearbox=gearbox.lab_bensh/ratio", "no device 'lab_bensh'; did you mean 'lab_bench'"),
        ("gearbox=gearbx/ratio", "no component 'gearbx'; did you mean 'gearbox'"),
    ],
)  # fmt: skip
def test_what_it_lacks_is_one_sentence_with_the_way_out(
    site: Path, tmp_path: Path, change: str, said: str
) -> None:
    code, out, err = call(site, tmp_path, *RUN, "--set", change, blocked="casadi")
    assert (code, out) == (2, "") and said in err
    assert len(err.strip().splitlines()) == 1


def test_packed_fmus_are_those_that_are_built(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path))
    library = Library(made)
    (base,) = {n for n in library.names() if n.startswith("omni_wheels")}
    effects = library.candidates(base)
    assert effects
    names = [f"{base}+{effect}@{port}" for effect, port, _ in effects]
    found = [library.find(name) for name in names]
    assert all(path is not None and path.is_relative_to(tmp_path) for path in found)
    monkeypatch.undo()
    assert found[0] is not None and found[0].read_bytes() == fmu(names[0]).read_bytes()
    assert all(library.has(name) for name in names)
    assert not library.has(names[0] + "+noise") and library.find(names[0] + "+noise") is None
    assert library.near(names[0].rpartition("@")[0]) == [
        n for n in names if n.startswith(names[0].rpartition("@")[0] + "@")
    ]


def test_what_does_not_fit_is_known(made: Path, tmp_path: Path) -> None:
    content = json.loads(gzip.decompress((made / CATALOGUE).read_bytes()))
    content["impossible"] = ["gearbox-ratio+backlash@x"]
    (tmp_path / CATALOGUE).write_bytes(gzip.compress(json.dumps(content).encode()))
    library = Library(tmp_path)
    assert library.has("gearbox/ratio+backlash@x")
    with pytest.raises(VariantError, match="its effects do not fit"):
        library.find("gearbox/ratio+backlash@x")


def test_damage_is_seen(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "library"
    shutil.copytree(made, folder)
    library = Library(folder)
    pack, keys = next((k, v) for k, v in library.content["packs"].items() if v[0][0] == "2")
    variant = keys[0].removeprefix("2/").replace("-", "/", 1)
    path = library.find(variant)
    assert path is not None
    whole = path.read_bytes()
    path.write_bytes(whole[:-9])
    assert library.find(variant) == path and path.read_bytes() == whole  # unpacked again
    path.unlink()
    content = (folder / "packs" / pack).read_bytes()
    (folder / "packs" / pack).write_bytes(content[: len(content) // 2])
    with pytest.raises(CosimError, match=r"\.tar\.xz: is damaged .*; reinstall"):
        Library(folder).find(variant)
    for damaged in (b"{", gzip.compress(b"{"), (made / CATALOGUE).read_bytes()[:-99]):
        (folder / CATALOGUE).write_bytes(damaged)
        with pytest.raises(CosimError, match=r"catalogue\.json\.gz: is damaged"):
            Library(folder).find("gearbox/none")


def test_packs_are_the_same_bytes_for_the_same_fmus(tmp_path: Path) -> None:
    names = ("gearbox.lab_bench/ratio", "inertia.lab_bench/disc")
    files = [(f"2/{fmu(name).stem}", fmu(name)) for name in names]
    for name in "ab":
        write_pack(tmp_path / name, files)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a").stat().st_size < sum(path.stat().st_size for _, path in files)
