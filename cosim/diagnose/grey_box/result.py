"""A law from data with all that is said about it, and the FMU that carries it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ...files import make_folder
from ..linear import BAND, SampleStack
from ..models import Fitted, compare
from ..search import Search
from .basis import ALONG_X, ALONG_Y
from .bench import Site
from .nearest import Named
from .trial import Law, Maker

Vector = NDArray[np.float64]
POINTS, ACROSS = 121, (41, 25)
"""Of a curve, and of a surface along both signals."""


@runtime_checkable
class Writer(Protocol):
    """A provider that writes FMUs with start values of their own."""

    def written(self, variant: str, starts: Mapping[str, float], path: Path) -> Path:
        """Write the variant's FMU with start values by variable; returns the path."""
        ...


@dataclass
class LawFromData:
    """What was found out at a place.

    Attributes:
        site: where.
        made: whether there is a law that unused runs want.
        reason: one or two sentences.
        search, base: the data, and the model that lacks the law.
        maker, law: of the law, None where no signal carries one.
        smooth: the smooth law; `law` is a formula where one does as well.
        named: laws with a name beside it, the most probable first.
        needed: log likelihood that unused runs had to gain [nats].
        fmu: the variant that carries it, once it is written.
    """

    site: Site
    made: bool
    reason: str
    search: Search
    base: Fitted
    maker: Maker | None = None
    law: Law | None = None
    smooth: Law | None = None
    named: list[Named] = field(default_factory=list)
    needed: float = 0.0
    fmu: Path | None = None
    _seen: list[Vector] = field(default_factory=list, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """As `law_from_data` in the JSON."""
        table: dict[str, Any] = {
            "place": self.site.label, "component": self.site.instance, "port": self.site.port,
            "element": self.site.element, "unit": self.site.unit, "made": self.made,
            "reason": self.reason,
        }  # fmt: skip
        law = self.law
        if law is None or self.smooth is None or self.maker is None or law.fitted.gate is None:
            return table
        points, visits, grid = self._points(self.maker, law)
        value, deviation = law.values(*points)
        narrow = law.values(*points, held=True)[1]
        named = []
        for item in self.named:
            gate = compare(self.search.check_data, item.fitted.check, law.fitted.check,
                           self.search.checking)  # fmt: skip
            named.append(item.to_dict(self.smooth, gate.gain, self.search.unused, points, visits))
        return table | {
            "form": law.shape.form,
            "depends_on": law.shape.label,
            "formula": law.formula,
            "signals": [
                {"name": axis.signal, "axis": name, "low": axis.first, "high": axis.last,
                 "repeats": axis.turn, "without_sign": axis.fold}
                for name, axis in (("x", law.shape.x), ("y", law.shape.y)) if axis is not None
            ],
            "coefficients": self._coefficients(law),
            "curve": {
                "driver": law.shape.axes[0].signal,
                "shape": grid, "deviation": deviation.tolist(),
                **({} if None not in (law.shape.x, law.shape.y)
                   else {"at": points[0 if law.shape.x else 1].tolist()}),
                "x": points[0].tolist(), "y": points[1].tolist(),
                "value": value.tolist(), "low": (value - BAND * deviation).tolist(),
                "high": (value + BAND * deviation).tolist(), "visited": visits.tolist(),
                "low_others_held": (value - BAND * narrow).tolist(),
                "high_others_held": (value + BAND * narrow).tolist(),
            },
            "gate": {
                "gain_nats": law.fitted.gate.gain, "z": law.fitted.gate.z,
                "needed_nats": self.needed,
                "unused_runs": [r.name for r in self.search.checking.runs
                                if r.purpose != "identification"],
            },
            "error": (errors := self.errors(law)),
            "channels": {
                name: {"unit": row["unit"], "noise_rms": row["noise_rms"],
                       **{which: row[which]["validation"] for which in ("before", "after")}}
                for name, row in errors.items()
            },
            "declared": self._declared(law),
            "nearest": named,
            "fmu": None if self.fmu is None else str(self.fmu),
        }  # fmt: skip

    def _points(self, maker: Maker, law: Law) -> tuple[list[Vector], Vector, list[int]]:
        """Points at which the law is shown, how often the runs come near, and their grid."""
        self._seen = self._seen or maker.visited(law)
        axes = [law.shape.x, law.shape.y]
        lines, indices = [], []
        for axis, values, count in zip(axes, self._seen, ACROSS, strict=True):
            if axis is None:
                lines.append(np.zeros(1))
                indices.append(np.zeros(values.size, dtype=np.intp))
                continue
            size = POINTS if None in axes else count
            if axis.turn:
                line = np.linspace(axis.first, axis.last, size)
                values = np.mod(values, axis.last)
            else:  # as dense as its knots
                first, last = np.arcsinh(np.array([axis.first, axis.last]) / axis.scale).tolist()
                bent = np.linspace(first, last, size)
                line = axis.scale * np.sinh(bent)
            lines.append(line)
            middles = 0.5 * (line[1:] + line[:-1])
            indices.append(np.searchsorted(middles, values))
        grid = [line.size for line in lines]
        place = indices[0] * grid[1] + indices[1]
        visits = np.bincount(place, minlength=grid[0] * grid[1]) / max(place.size, 1)
        x, y = np.meshgrid(*lines, indexing="ij")
        return [x.ravel(), y.ravel()], visits, grid

    def _declared(self, law: Law) -> dict[str, Any]:
        """Declared parameters with what the whole law leaves open of them."""
        estimate, found = law.fitted.estimate, {}
        more = BAND * law.declared(self.base.problem.scale)
        for i, p in enumerate(self.base.problem.parameters):
            if p.role == "declared":
                value, low, high = (v[i] for v in (estimate.theta, estimate.low, estimate.high))
                ends = (max(value - np.hypot(value - low, more[i]), p.minimum),
                        min(value + np.hypot(high - value, more[i]), p.maximum))  # fmt: skip
                found[p.name] = {"value": float(value), "unit": p.unit, "ci95": [*map(float, ends)]}
        return found

    @staticmethod
    def _coefficients(law: Law) -> list[dict[str, Any]]:
        """Those of the FMU that are not 0, or those of the named terms."""
        turn = np.eye(law.free.size) if law.trial.words else law.trial.expansion
        values, deviation = turn @ law.free, law.spread(turn)
        names = law.trial.words or [f"c[{i + 1}]" for i in range((ALONG_X + 1) * ALONG_Y)]
        return [
            {"name": name, "value": float(value), "ci95": [float(value - BAND * one),
                                                            float(value + BAND * one)]}
            for name, value, one in zip(names, values, deviation, strict=True) if value != 0.0
        ]  # fmt: skip

    def errors(self, law: Law) -> dict[str, Any]:
        """RMS residual of each channel in its unit, by purpose, without the law and with it.

        None for unused runs where there are none.
        """
        search = self.search
        table: dict[str, Any] = {
            c.name: {"unit": c.unit, "noise_rms": c.sigma, "before": {}, "after": {}}
            for c in search.raw.channels
        }
        for which, fitted in (("before", self.base), ("after", law.fitted)):
            for purpose, vector, stack in (
                ("identification", search.fit_data - fitted.fit, search.fitting),
                ("validation", search.check_data - fitted.check, search.checking),
            ):
                there = purpose == "identification" or search.unused
                for name, value in rms(vector, stack).items():
                    table[name][which][purpose] = value if there else None
        return table

    def leave_fmu(self, out: Path | None) -> list[Path]:
        """Write the FMU of the component with the law built in, calibrated values as well.

        Where it cannot be built, the reason says so.

        Args:
            out: folder below which it goes, None for nowhere.

        Returns:
            its path, if there is one.
        """
        law, provider = self.law, self.base.problem.provider
        if out is None or law is None or not self.made or not isinstance(provider, Writer):
            return []
        problem, instance = law.fitted.problem, self.site.instance
        runs = {name for run in problem.runs for name in run.starts}
        runs |= {name for p in problem.parameters if p.run for name, _ in p.targets}
        starts = {
            name.partition(".")[2]: value
            for name, value in problem.values(law.fitted.estimate.theta, problem.runs[0]).items()
            if name.partition(".")[0] == instance and name not in runs
        }
        folder = make_folder(out / "fmus")
        path = folder / f"{instance}-law_from_data.fmu"
        try:
            self.fmu = provider.written(problem.instances[instance], starts, path)
        except CosimError as error:
            self.reason += f" Its FMU could not be built: {error}."
            return []
        return [self.fmu]


def rms(vector: Vector, stack: SampleStack) -> dict[str, float | None]:
    """Channel -> RMS of a residual over sigma, in the channel's unit."""
    found: dict[str, float | None] = {}
    for index, channel in enumerate(stack.problem.channels):
        mine = vector[stack.channel == index]
        found[channel.name] = (
            float(np.sqrt(np.mean(mine**2))) * channel.sigma if mine.size else None
        )
    return found
