"""Which FMUs a wheel carries: what its scenarios, studies and diagnoses ask for.

Nothing is listed by hand: the catalogue, the systems, the scenarios, the studies and the mappings
below `scenarios/` say it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cosim.calibrate.mapping import find_system
from cosim.calibrate.model import Model
from cosim.calibrate.parts import Coarse
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import balances, candidates, element_of
from cosim.diagnose.localise import PROBE
from cosim.diagnose.probes import batches
from cosim.files import read_toml
from cosim.installation import places
from cosim.installation.examples import read_mapping
from cosim.robots import create, templates
from cosim.running.runner import prepare
from cosim.scenario.scenario import scenario_files
from cosim.spec.variant import parse_name
from cosim.study.definition import read_study
from cosim.study.planning import plan_study
from cosim.system.provider import Provider
from cosim.system.toml import DeclaredConnection, SystemFile, read_system
from cosim.system.variants import apply, component
from sources.model import ModelError
from sources.packaging import catalog
from sources.variant import build_model, fidelities


class Asked:
    """A provider that notes what it is asked for."""

    def __init__(self, inner: Provider) -> None:
        self.inner = inner
        self.variants: dict[str, None] = {}

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU, from the inner provider."""
        self.variants[str(parse_name(variant))] = None
        return self.inner.path(variant)

    def candidates(self, variant: str) -> list[tuple[str, str, str]]:
        """As of the catalogue."""
        return catalog.candidates(variant)

    def refinements(self, variant: str) -> list[dict[str, Any]]:
        """As of the catalogue."""
        return catalog.refinements(variant)


def system_files() -> list[SystemFile]:
    """All systems below `scenarios/`."""
    found = sorted(places.scenarios().rglob("*.toml"))
    return [read_system(path) for path in found if "instances" in read_toml(path)]


def _swaps(reference: str) -> Iterator[str]:
    """A variant, and the other fidelities of the same device."""
    name = parse_name(reference)
    yield reference
    for fidelity in fidelities(name.component):
        yield f"{name.model}/{fidelity}"


def plain(provider: Provider) -> list[str]:
    """Every fidelity of every component, for the devices of all systems too; and what scenarios,
    studies and the systems of all logs ask for, effects included.
    """
    found = dict.fromkeys(name for name in catalog.names() if "+" not in name)
    for file in system_files():
        for reference in file.instances.values():
            if component(reference):
                found |= dict.fromkeys(str(parse_name(name)) for name in _swaps(reference))
    asked = Asked(provider)
    for scenario in scenario_files():
        for run in scenario.runs:
            prepare(scenario.scenario(run), asked)
    for path in sorted((places.scenarios() / "studies").glob("*.toml")):
        plan_study(read_study(path), asked)
    for path in mappings():
        instances = declared(path, provider).instances.values()
        found |= dict.fromkeys(str(parse_name(name)) for name in instances if component(name))
    return list(found | asked.variants)


def _has_data(path: Path) -> bool:
    return (path.parent / "data").is_dir()


def mappings() -> dict[Path, dict[str, Any]]:
    """All mappings below `scenarios/`, those of rigs first, with what they say."""
    found = sorted(places.scenarios().rglob("*.toml"), key=lambda p: (not _has_data(p), p))
    return {p: read_mapping(p) for p in found if {"channels", "base"} & set(read_toml(p))}


def searched() -> list[Path]:
    """Mappings below `scenarios/` whose systems are searched for what they lack, rigs first.

    Not those of public logs, which name their `origin`: the wheel does not bring the logs, and
    effects for all of them would be half of it. Not those that say `diagnosed = false`: logs that
    are made for `cosim calibrate`, and rigs with hundreds of large FMUs and no logs here. Not those
    that another one names in `further`: what it finds is only judged on their runs.
    """
    tables = mappings()
    further = {p.parent / name for p, table in tables.items() for name in table.get("further", ())}
    return [
        path for path, table in tables.items()
        if path not in further and "origin" not in table and table.get("diagnosed", True)
    ]  # fmt: skip


def declared(mapping: Path, provider: Provider) -> Problem:
    """The declared system of a mapping as a problem without data."""
    file = find_system(mapping, str(read_mapping(mapping).get("system", "")))
    return Problem(mapping.parent.name, Model.of(file, provider), (), (), (), 1.0, Coarse(1.0))


def of_templates(provider: Provider) -> list[Problem]:
    """The systems of all templates that need no device, as problems without data.

    Who begins with one has logs of a robot that no wheel knows.
    """
    found = []
    with TemporaryDirectory() as folder:
        for name in templates.names():
            template = templates.read(name, {})
            if template.inputs:  # an arm's come from its device
                out = Path(folder) / name
                create.from_template(name, out, template, provider, logs=False)
                found.append(declared(out / "dataset.toml", provider))
    return found


def geared_motor(provider: Provider) -> Problem:
    """A motor on a logged voltage, a gear and a load: what a first log of one's own shows."""
    instances = {
        "bare_motor": "bare_motor/winding", "gearbox": "gearbox/ratio", "inertia": "inertia/disc",
    }  # fmt: skip
    wires = (
        DeclaredConnection("bare_motor.tau", "gearbox.tau_a"),
        DeclaredConnection("gearbox.w_a", "bare_motor.w"),
        DeclaredConnection("gearbox.tau_b", "inertia.tau"),
        DeclaredConnection("inertia.w", "gearbox.w_b"),
        DeclaredConnection("gearbox.J_b", "inertia.J_added"),
    )
    file = SystemFile(places.scenarios(), "geared_motor", "", instances, {}, wires)
    return Problem(file.name, Model.of(file, provider), (), (), (), 1.0, Coarse(1.0))


def beside_foreign(provider: Provider) -> Problem:
    """What stands beside an FMU without sources: the bench of the example, and all adapters."""
    instances = {"motor": "bare_motor/winding", "rotor": "rotor/rigid"}
    instances |= {name: f"adapter/{name}" for name in fidelities("adapter")}
    wires = (
        DeclaredConnection("motor.tau", "rotor.tau_a"), DeclaredConnection("rotor.w", "motor.w"),
    )  # fmt: skip
    file = SystemFile(places.scenarios(), "beside_foreign", "", instances, {}, wires)
    return Problem(file.name, Model.of(file, provider), (), (), (), 1.0, Coarse(1.0))


def of_diagnosis(problem: Problem) -> list[str]:
    """Variants that the first round of a diagnosis may ask for.

    All candidates together, as they are scored, one by one, as they are fitted, and an unknown
    input at each place.
    """
    known = candidates(problem)
    changes = [b.change for b in batches(known, problem) if b.change]
    changes += [c.change for c in known]
    places_ = set(balances(problem))
    vectors = {(i, part[0]) for i, port in places_ if (part := element_of(port))}
    changes += [{i: f"+{PROBE}@{port}"} for i, port in sorted(places_ - vectors)]
    return _variants(problem, changes)


def _variants(problem: Problem, changes: Iterable[dict[str, str]]) -> list[str]:
    found: dict[str, None] = {}
    for change in changes:
        instances = apply(problem.instances, change, problem.provider)
        for instance in change:
            found[str(parse_name(instances[instance]))] = None
    return list(found)


def sorted_out(names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Those of these variants that exist, and those whose effects do not fit, or not together.

    A candidate alone fits. The unknown input does not at every balance: nothing can enter at a mass
    centre.
    """
    found, impossible = [], []
    for name in names:
        effects = [effect for effect, _ in parse_name(name).effects]
        try:
            if len(effects) > 1 or PROBE in effects:
                build_model(name)
        except ModelError:
            impossible.append(name)
        else:
            found.append(name)
    return found, impossible
