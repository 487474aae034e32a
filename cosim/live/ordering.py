"""Samples in the order of their times: what is late, doubled or missing is counted."""

from __future__ import annotations

import heapq
from collections import deque
from dataclasses import dataclass

from .messages import Sample

REMEMBERED = 4096
"""Released times that are remembered, to tell doubled samples from late ones."""
SAME = 1e-3
"""Part of an interval within which two times are one."""


@dataclass
class Counts:
    """What became of samples.

    Attributes:
        samples: used.
        late: came after later ones had been used, and were not.
        doubled: were there already.
        missing: never came, by their numbers or by the usual interval.
        unreadable: lines that were no message.
        ignored: before the begin of a run was told.
    """

    samples: int = 0
    late: int = 0
    doubled: int = 0
    missing: int = 0
    unreadable: int = 0
    ignored: int = 0


class Sorter:
    """Holds samples back until those before them had time to come.

    Args:
        interval: usual one between samples [s].
        wait: how much later samples may be by the machine's clock before one counts as late [s].
        counts: where samples are counted.
    """

    def __init__(self, interval: float, wait: float, counts: Counts) -> None:
        self.interval, self.wait, self.counts = interval, wait, counts
        self._serial = 0
        self.restart()

    def restart(self) -> None:
        """Forget all samples: what comes now may have other times."""
        self._heap: list[tuple[float, int, Sample]] = []
        self._seen: set[int] = set()
        self._past: deque[int] = deque()
        self._last: Sample | None = None
        self._newest = float("-inf")

    def _key(self, time: float) -> int:
        return round(time / (SAME * self.interval))

    def push(self, sample: Sample) -> None:
        """Take a sample; it is dropped if it is late or doubled."""
        key = self._key(sample.time)
        seen = self._seen
        if key in seen or key - 1 in seen or key + 1 in seen:
            self.counts.doubled += 1
        elif self._last is not None and sample.time <= self._last.time:
            self.counts.late += 1
        else:
            self._serial += 1
            seen.add(key)
            heapq.heappush(self._heap, (sample.time, self._serial, sample))
            self._newest = max(self._newest, sample.time)

    def release(self, everything: bool = False) -> list[Sample]:
        """Samples whose turn it is."""
        found = []
        while self._heap and (everything or self._heap[0][0] <= self._newest - self.wait):
            _, _, sample = heapq.heappop(self._heap)
            key = self._key(sample.time)
            self._past.append(key)  # still among those seen
            if len(self._past) > REMEMBERED:
                self._seen.discard(self._past.popleft())
            self._count_missing(sample)
            self._last = sample
            found.append(sample)
        self.counts.samples += len(found)
        return found

    def _count_missing(self, sample: Sample) -> None:
        last = self._last
        if last is None:
            return
        if sample.number is not None and last.number is not None:
            self.counts.missing += max(sample.number - last.number - 1, 0)
        else:
            self.counts.missing += max(round((sample.time - last.time) / self.interval) - 1, 0)
