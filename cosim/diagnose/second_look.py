"""What is asked once more where the rounds' model leaves more than noise: all laws around the
sheet's values, where calibration has hidden nothing yet.
"""

from __future__ import annotations

from .models import Fitted
from .result import PURPOSES
from .rounds import Round
from .search import Search
from .verdict import TENTH
from .whiteness import WhitenessTest, structured, whiteness_tests


def tests_of(search: Search, fitted: Fitted, purpose: str) -> list[WhitenessTest]:
    """Tests on what a model leaves in the runs of a purpose; see `Judge.beside` of unused ones."""
    if purpose == PURPOSES[0]:
        return whiteness_tests(search.fit_data - fitted.fit, search.fitting)
    return whiteness_tests(search.beside(fitted), search.checking)


def leaves_law(search: Search, fitted: Fitted) -> bool:
    """Whether a model leaves more than noise that is not white: white noise has no law.

    One channel that is not is enough, and then the others may be of the same law.
    """
    left = [t for p in PURPOSES for t in tests_of(search, fitted, p) if t.structured]
    return not all(t.white for t in left)


def leaves_more(search: Search, fitted: Fitted) -> bool:
    """Whether a model leaves what is no noise, however stated; of a set, also in slow parts.

    What a wrong law leaves in unused runs may be less than sheets tell noise apart by, and last for
    seconds all the same.
    """
    left = [t for p in PURPOSES for t in tests_of(search, fitted, p)]
    count = len(left)  # one of so many tests (Bonferroni)
    slow = any(structured(t.slow, count * t.p_value) and not t.white for t in left)
    return leaves_law(search, fitted) or (slow and bool(fitted.effects))


def around_nominal(search: Search, current: Fitted) -> Round | None:
    """A round around nominal values whose law explains more than a model with more than noise left.

    Not asked where what is left is a tenth (RMS) of what was explained: a model that evidently does
    nearly what the right one does. Nor where start values that decide when casters turn over hide
    first orders.
    """
    declared = search.memo.declared
    beyond = current.estimate.robust - 0.5 * current.estimate.count
    explained = declared.estimate.robust - current.estimate.robust
    if current.effects and beyond <= TENTH**2 * explained:
        return None
    if search.raw.unstable or not leaves_more(search, current):
        return None
    search.say("more than noise is left: which law explains most around nominal values?")
    return search.around_nominal(current)
