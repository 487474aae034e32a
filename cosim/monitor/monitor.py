"""The whole chain: baseline, patterns, changes."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..calibrate.checks.examine import check_data
from ..calibrate.checks.finding import Finding, lines, passed
from ..calibrate.fit import Effort, fit
from ..calibrate.parts import PURPOSE
from ..calibrate.simulator import Simulator
from ..diagnose.candidates import candidates
from ..errors import InputError, UnknownNameError, listing
from .detector import Detector
from .evidence import Evidence
from .patterns import Patterns, patterns, representatives, sorted_out
from .result import Monitored
from .series import LEAST, Series, read_series

RATE = 1e-3
"""Probability of any alarm on a series in which nothing changes: one false alarm in a thousand
series."""
FAR = 2.0
"""What the model may leave of a channel in the first logs, over its noise; noise that is guessed is
up to half as much again."""
BASELINE = 10
"""Logs from which parameters and control limits are taken: their spread is then known to a
quarter."""


def monitor(
    series: Series | Path | str,
    say: Callable[[str], None] = lambda text: None,
    *,
    baseline: int | None = None,
    rate: float = RATE,
    workers: int | None = None,
    without: Iterable[str] = (),
    known: Patterns | None = None,
) -> Monitored:
    """Say what has changed over a series of logs of one machine, since when, and what it is.

    Not modelled: logs that depend on each other, as by the season; what changes slowly without a
    log before it.

    Args:
        series: the logs, or their folder.
        say: told what is done.
        baseline: number of first logs that parameters and control limits are taken from; ten, or
            half of them if there are fewer than twenty, unless given.
        rate: probability of any alarm on a series in which nothing changes.
        workers: threads, one per core if not given.
        without: effects that are left out of the catalogue.
        known: patterns of the same machine and excitations, which are not simulated again.

    Raises:
        CosimError: a file is wrong, the data cannot be used, or the system cannot be simulated.
    """
    begun = time.perf_counter()
    if not isinstance(series, Series):
        series = read_series(series)
    series, warnings = _usable(series)
    count = len(series.logs)
    if not 0.0 < rate < 1.0:
        raise InputError(f"the rate of false alarms is {rate:g}, not between 0 and 1")
    most = count - LEAST // 2
    if baseline is None:
        baseline = min(BASELINE, count // 2)  # what changes is in the later half rather
    if not 2 <= baseline <= most:
        raise InputError(f"a baseline of {baseline} of {count} logs: take 2 to {most}")
    if known is None:
        with threadpool_limits(1, user_api="blas"):  # its threads wait at the cost of simulations
            known = baseline_patterns(
                series, say, baseline=baseline, workers=workers, without=without
            )
    say("looking for changes")
    detector = Detector(Evidence(series, known), rate)
    found = detector.found()
    calm = np.sqrt(np.nanmean(found.rest[:baseline], axis=0))
    if np.any(calm > FAR):  # first orders around a model that is far off tell no laws apart
        found.changes = [replace(c, fits=c.fits and not c.by_shape) for c in found.changes]
    for channel, size in zip(series.problem.channels, calm.tolist(), strict=True):
        if size > FAR:
            warnings.append(
                f"the model leaves {size:.2g} times the noise of {channel.name} in the first logs "
                "already, so names are less sure: run cosim diagnose on them first"
            )
    for first in sorted({shape.first for shape in detector.unseen}):
        warnings.append(
            f"log {series.logs[first].name} is driven otherwise than logs before it: what changed "
            "just then is not seen"
        )
    for name, correlation in found.alone.items():
        warnings.append(
            f"{name} of successive logs is correlated by {correlation:.2f}: logs are not "
            "independent (a season, a warming), so false alarms come oftener than stated"
        )
    return Monitored(
        series, known, found, baseline, rate, warnings, time.perf_counter() - begun
    )  # fmt: skip


def plain_lines(findings: Iterable[Finding]) -> list[str]:
    """Warnings in a line each, of those that are alike together, without the word."""
    found = lines(f for f in findings if f.severity == "warning")
    return [text.removeprefix("warning: ") for text in found]


def _usable(series: Series) -> tuple[Series, list[str]]:
    """The series without logs that cannot be used, and warnings.

    Raises:
        InputError: too few are left.
    """
    problem, warnings = series.problem, plain_lines(series.problem.source.findings)
    plain = problem.changed(
        runs=[replace(run, purpose=PURPOSE) for run in problem.runs],
        source=replace(problem.source, findings=()),
    )
    kept, known = [], dict[bytes, str]()
    for log in series.logs:  # one by one: what is alike in all logs of a machine is no finding
        findings = passed(check_data(plain.only(log.runs)), problem.source.allow)
        wrong = lines(f for f in findings if f.severity == "error")
        content = b"".join(problem.run(name).data.tobytes() for name in log.runs)
        other = known.setdefault(hashlib.sha256(content).digest(), log.name)
        if other != log.name:
            wrong.append(f"it is a copy of log {other}")
        if wrong:
            warnings.append(f"log {log.name} is not used: {'; '.join(wrong)}")
        else:
            kept.append(log)
            warnings += plain_lines(findings)
    if len(kept) < LEAST:
        raise InputError(
            f"{series.name}: {len(kept)} of {len(series.logs)} logs can be used, and it takes "
            f"{LEAST}: {'; '.join(warnings)}"
        )
    if len(kept) == len(series.logs):
        return series, warnings
    return replace(
        series, logs=tuple(kept), problem=problem.only(n for log in kept for n in log.runs),
        left_out=len(series.logs) - len(kept),
    ), warnings  # fmt: skip


def baseline_patterns(
    series: Series,
    say: Callable[[str], None] = lambda text: None,
    *,
    baseline: int = BASELINE,
    workers: int | None = None,
    without: Iterable[str] = (),
) -> Patterns:
    """Fit the first logs, and simulate what parameters and effects do around them.

    Raises:
        CosimError: the system cannot be simulated, or no effect of that name fits it.
    """
    problem = series.problem
    keys = sorted_out(problem)
    calm = [name for log in series.logs[:baseline] for name in log.runs]
    chosen, fitted = representatives(problem, keys, calm)
    say(
        f"{len(series.logs)} logs with {len(chosen.runs)} excitations; fitting the first {baseline}"
    )
    as_fitted = [replace(run, purpose=PURPOSE) for run in chosen.runs]
    simulator = Simulator(chosen.changed(runs=as_fitted), workers=workers)
    far = fit(
        simulator.of(simulator.problem.changed(step=problem.search.step)), purpose=fitted,
        effort=Effort("far", "draft"),
    )  # fmt: skip
    estimate = fit(simulator, far.theta, fitted, effort=Effort("there", "draft"))
    theta = estimate.theta.copy()
    for place, p in enumerate(chosen.parameters):
        if p.run:  # values of single runs are fitted log by log
            theta[place] = p.nominal
    offered = candidates(chosen)
    names = sorted({c.effect for c in offered})
    left_out = set(without)
    for name in sorted(left_out - set(names)):
        raise UnknownNameError(
            f"{problem.file.path}: no effect {name!r} of the catalogue fits this system; "
            f"{listing(names, name)}"
        )
    try:
        return patterns(
            simulator, np.clip(theta, chosen.lower, chosen.upper), keys,
            [c for c in offered if c.effect not in left_out], say,
        )  # fmt: skip
    finally:
        simulator.close()
