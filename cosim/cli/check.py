"""`cosim fmus check`: what is wrong with FMUs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from ..errors import CheckError, FmuFileError, InputError
from ..installation import places
from .streams import print_json


def check_command(
    files: Annotated[
        list[Path] | None, typer.Argument(help=".fmu files; those of the library if none is given.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Check FMUs, ours or anybody's, without running anything of them.

    Errors break the standard of FMI, or keep masters from running the FMU; warnings are allowed,
    but others may stumble over them.

    Example: `cosim fmus check gearbox.fmu`
    """
    from ..fmu.check import check

    paths = list(files or sorted(places.fmus().rglob("*.fmu")))
    for path in paths:
        if not path.is_file():
            raise FmuFileError(f"{path}: there is no such file")
    if not paths:
        raise InputError(f"{places.fmus()}: has no .fmu; build some with 'cosim fmus build'")
    results = {}
    bad = 0
    for path in paths:
        findings = check(path)
        results[str(path)] = [finding.to_dict() for finding in findings]
        bad += any(finding.severity == "error" for finding in findings)
        if not as_json:
            counts = Counter(finding.severity for finding in findings)
            shown = ", ".join(f"{number} {kind}(s)" for kind, number in counts.items())
            typer.echo(f"{path}: {shown or 'ok'}")
            for finding in findings:
                typer.echo(f"  {finding}")
    if as_json:
        content = {"checked": len(results), "with_problems": bad, "problems": results}
        print_json(content)
    if bad:
        raise CheckError(f"{bad} of {len(results)} FMUs have problems")
