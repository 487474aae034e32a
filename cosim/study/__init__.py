"""A scenario over variants, parameters, algorithms and steps, in parallel, resumed after a stop.

    from cosim.study import run_study

    result = run_study("scenarios/studies/motor_bench.toml", workers=2)
    result.to_pandas()

docs/study.md says how a study is written.
"""

from .definition import Algorithm, Distribution, ReferenceRun, Sample, Study, read_study, study_from
from .run import Progress, StudyResult, run_study
from .table import StudyTable

__all__ = [
    "Algorithm",
    "Distribution",
    "Progress",
    "ReferenceRun",
    "Sample",
    "Study",
    "StudyResult",
    "StudyTable",
    "read_study",
    "run_study",
    "study_from",
]
