"""ecos runs chains of our FMUs, FMI 2 and FMI 3, with our results.

It needs libtbb.so.12, which the package tbb brings; without it these tests skip with the loader's
message.
"""

from __future__ import annotations

import pytest

from tests.clients.chains import CHAINS, assert_agree, jacobi, run_foreign
from tests.outside import require

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", CHAINS)
def test_chain_agrees_with_our_loop(name: str, fmi: int) -> None:
    require("ecospy")
    chain = CHAINS[name]
    # ecos exchanges once per instance before the first step and reads outputs after an exchange
    expected = jacobi(chain, fmi=fmi, exchanges=len(chain.instances), read_after_exchange=True)
    assert_agree(run_foreign("ecospy", chain, fmi=fmi), expected)


def test_fmi_3_is_fmi_2() -> None:
    require("ecospy")
    chain = CHAINS["sampled"]
    assert_agree(run_foreign("ecospy", chain, fmi=3), run_foreign("ecospy", chain, fmi=2))
