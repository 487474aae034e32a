"""libcosim (FMI 2) runs chains of our FMUs with our results."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.clients.chains import CHAINS, assert_agree, jacobi, run_foreign
from tests.outside import require

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", CHAINS)
def test_chain_agrees_with_our_loop(name: str) -> None:
    require("libcosimpy")
    chain = CHAINS[name]
    # libcosim exchanges until nothing changes, and its observer reads before the next exchange
    assert_agree(run_foreign("libcosimpy", chain), jacobi(chain))


def test_a_python_fmu_among_native_ones() -> None:
    require("libcosimpy")
    chain = replace(CHAINS["closed_loop"], count=200)
    kinds = {"motor": "python"}
    assert_agree(run_foreign("libcosimpy", chain, kinds=kinds), jacobi(chain))
