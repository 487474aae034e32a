"""The commands of `cosim arm`: arms from URDF and MJCF files."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, VariantError
from ..installation.builder import naming_errors, sources
from ..spec import devices
from .output import AsJson, new_table, open_console, say
from .streams import print_json

arm_app = typer.Typer(
    help="Serial arms of your own: from a URDF or MJCF file to FMUs.", no_args_is_help=True
)

FIDELITIES = (
    "serial_arm.{}/kinematic",
    "serial_arm.{}/rigid",
    "serial_arm.{}/rigid_moving",
    "serial_arm.{}/elastic",
    "moved_arm.{}/rigid",
    "arm_drive.{}/hold",
    "joint_trajectory.{}/quintic",
    "joint_trajectory.{}/swing",
    "joint_trajectory.{}/multisine",
)
MASSLESS = ("serial_arm.{}/kinematic", *FIDELITIES[5:])
"""What can be built of an arm whose file has no masses."""


@arm_app.command("import")
def import_command(
    file: Annotated[Path, typer.Argument(help="A .urdf, or an .xml of MuJoCo.")],
    base: Annotated[str, typer.Option(help="Link that the arm stands on [the root].")] = "",
    tip: Annotated[str, typer.Option(help="Link of the flange [the end of the chain].")] = "",
    name: Annotated[str, typer.Option(help="Name of the device [that of the robot].")] = "",
    out: Annotated[Path, typer.Option(help="Folder of device files.")] = Path(devices.FOLDER),
    build: Annotated[bool, typer.Option(help="Build the FMUs, too.")] = True,
    replace: Annotated[
        bool, typer.Option("--replace", help="Write over a device file that differs.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a device file and FMUs of a serial arm.

    FMUs go beside the device file. Variants are `serial_arm.NAME/rigid` and so on; they are found
    in `devices/` of the current folder and in folders that COSIM_DEVICES names.

    Example: `cosim arm import panda.urdf --tip panda_link8`
    """
    from ..robots import device, reader

    arm = reader.read_arm(file, base, tip)
    wanted = name or re.sub(r"\W+", "_", arm.name).strip("_").lower() or "arm"
    if not re.fullmatch(r"\w+", wanted):
        raise InputError(f"--name {wanted!r}: a device's name has letters, digits and _ only")
    path = out / f"{wanted}.toml"
    text = device.text(arm, file.name)
    if path.is_file() and path.read_text(encoding="utf-8") != text and not replace:
        raise InputError(
            f"{path} is there and differs (another robot, or changed by hand); give another "
            "--name, or --replace"
        )
    for component in device.COMPONENTS if build else ():
        if wanted in sources("variant").shipped_devices(component):
            raise InputError(
                f"--name {wanted!r} is a device of {component!r} that comes with cosim; give "
                "another"
            )
    try:
        out.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
    massless = arm.massless()
    templates = MASSLESS if massless else FIDELITIES
    variants = [template.format(wanted) for template in templates]
    notes = list(arm.notes)
    if massless:
        notes.append(
            f"nothing beyond joint {massless!r} has mass: only fidelities without dynamics are "
            "built; add <inertial> to the links"
        )
    for note in notes:
        say(f"note: {note}")
    files = _built(variants, out, path) if build else []
    searched = out in devices.folders()
    if as_json:
        print_json(
            {
                "device": wanted, "file": str(path), "base": arm.base, "tip": arm.tip,
                "joints": [joint.name for joint in arm.joints], "notes": notes,
                "variants": variants, "fmus": [str(item) for item in files],
            }
        )  # fmt: skip
    else:
        table = new_table("joint", "name", "type", "from", "to", "largest torque", "carries")
        for k, (joint, body) in enumerate(zip(arm.joints, arm.bodies, strict=True)):
            unit, effort = ("m", "N") if joint.kind == "prismatic" else ("rad", "N.m")
            table.add_row(
                str(k + 1), joint.name, joint.kind, _shown(joint.lower, unit),
                _shown(joint.upper, unit), _shown(joint.effort, effort), f"{body.mass:.4g} kg",
            )  # fmt: skip
        console = open_console()
        console.print(table)
        console.print(f"device file: {path}", soft_wrap=True)
        for variant in variants if build else ():
            console.print(variant, soft_wrap=True)
    if not searched:
        say(f"note: to use it by name, set {devices.VARIABLE}={out.resolve()}")


def _shown(limit: float, unit: str) -> str:
    return f"{limit:.4g} {unit}" if math.isfinite(limit) else "no limit"


def _built(variants: list[str], out: Path, path: Path) -> list[Path]:
    """FMUs of the device that has just been written."""
    import itertools

    try:
        build = sources("packaging.build").build
    except VariantError as error:
        raise VariantError(f"{path} is written, but {error}") from error
    done = itertools.count(1)
    with naming_errors(), devices.also(out):
        made = []
        for variant in variants:
            made.append(Path(build(variant, out=out)))
            say(f"{next(done)}/{len(variants)} {variant}")
        return made


@arm_app.command("base")
def base_command(
    device: Annotated[str, typer.Argument(help="Name of a device of serial_arm.")],
    as_json: AsJson = False,
) -> None:
    """List the base parameters of an arm: what torques can tell of its masses.

    Example: `cosim arm base panda`
    """
    with naming_errors():
        found: list[dict[str, Any]] = sources("packaging.catalog").base_parameters(device)
    if as_json:
        print_json(found)
        return
    table = new_table("parameter", "value", "unit", "is")
    for item in found:
        table.add_row(item["name"], f"{item['value']:.6g}", item["unit"], item["formula"])
    open_console().print(table)
