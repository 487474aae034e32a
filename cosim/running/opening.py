"""A scenario opened to be stepped from outside: `cosim.open`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..arguments import need_number, need_table, need_text
from ..errors import ValueRangeError, listing
from ..installation import builder
from ..master.twin import Twin
from ..system.provider import Provider
from .preparation import adjusted
from .runner import find_runs, prepare


def open(
    name: Path | str,
    *,
    variants: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    algorithm: str | None = None,
    options: Mapping[str, Any] | None = None,
    step: float | None = None,
    duration: float | None = None,
    record: Sequence[str] = (),
    record_period: float | None = None,
    provider: Provider | None = None,
    folder: Path | None = None,
) -> Twin:
    """Open one run of a scenario, to step it: `with cosim.open("motor_bench/ST1") as twin: ...`.

    Args:
        name: `mobile_manipulator/IY`, a folder, a scenario.toml, an .ssp archive or .ssd file.
        variants, parameters, algorithm, options, step, record, record_period, provider, folder:
            as of `cosim.run`.
        duration: how far it can go [s]; the scenario's if not given, `math.inf` for no end (its
            inputs are then held beyond their last values).

    Raises:
        CosimError: as of `cosim.run`; the name means several runs.
    """
    name = str(name) if isinstance(name, Path) else name
    need_text("the scenario to open", name, 'give its name, as in cosim.open("motor_bench/ST1")')
    need_table("variants of a twin", variants or {}, 'variants={"gearbox": "lossy"}')
    need_table("parameters of a twin", parameters or {}, 'parameters={"load.J": 0.09}')
    for what, value in (("step", step), ("duration", duration), ("record period", record_period)):
        if value is not None:
            need_number(f"{what} of a twin", value, "give it in seconds")
    whole, _, _, items = find_runs(name, folder, duration, step)
    if len(items) > 1:
        raise ValueRangeError(
            f"{whole} has {len(items)} runs and a twin is one of them; name it, as in "
            f"{whole}/{next(iter(items))}; {listing(items)}"
        )
    item = adjusted(
        next(iter(items.values())), algorithm=algorithm, options=options, step=step,
        duration=duration, record=record, record_period=record_period,
    )  # fmt: skip
    prepared = prepare(
        item, builder.default_provider() if provider is None else provider,
        variants=variants, parameters=parameters, base=Path.cwd(), scene=True,
    )  # fmt: skip
    return prepared.twin()
