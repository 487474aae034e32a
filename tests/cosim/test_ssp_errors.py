"""SSP packages that cannot be read: what the errors name."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import ssp
from cosim.errors import ConnectError, ScenarioError
from tests.ssp_files import (
    A,
    binding,
    component,
    connection,
    connectors,
    real,
    ssd,
    ssv,
    system,
)

INTEGERS = (
    '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
    "</ssc:IntegerMappingTransformation>"
)
TWO = component("a", A) + component("b", A)


@pytest.mark.parametrize(
    ("root", "message"),
    [
        (system(component("a", "resources/none.fmu")),
         r"component 'a' refers to 'resources/none.fmu', which the package does not hold"),
        (system(component("a", "../x.fmu")), r"component 'a' refers to .* leaves the package"),
        (system(component("a", "http://x/a.fmu")),
         r"component 'a' .* only files inside the package"),
        (system(component("a", A, attributes='implementation="ModelExchange"')),
         r"component 'a' asks for ModelExchange; only co-simulation is run"),
        (system(component("a", A, attributes='type="application/x-python"')),
         r"component 'a' is of type 'application/x-python'; FMUs and SSP can be read"),
        (system(component("a", A) * 2), r"the root system has two elements named 'a'"),
        (system(TWO, connection("a.y", "c.u")), r"names element 'c'; there is a, b"),
        (system(TWO, connection("a.yy", "b.u")),
         r"connector 'yy' of a is no variable of 'affine'; did you mean 'y'"),
        (system(TWO, connection("a.y", "b.u"), connection(".x", "b.u")),
         r"names connector 'x' of the root system; there is none"),
        (system(TWO, connection("a.next", "b.n", INTEGERS)),
         r"a.next - b.n has an integer mapping, which cannot be run between FMUs"),
        (system(component("a", A, connectors(y="output Real stone"))),
         r"connector 'y' of 'a' has unit 'stone', which the file does not define"),
        (system(component("a", A, binding(ssv(real("a", "much"))))), r"parameter 'a': could not"),
        (system(component("a", A, binding(ssv('<ssv:Parameter name="a"><ssv:Binary value="00"/>'
                                              "</ssv:Parameter>")))),
         r"parameter 'a' is of type Binary, which cannot be given to an FMU"),
        (system(component("a", A, binding(ssv(real("a", "1 2"))))),
         r"parameter 'a' has 2 values, but a.a takes 1"),
        (system(component("a", A, binding(ssv(real("a", "1"), real("a", "2"))))),
         r"parameter 'a' is given twice in one set"),
        (system(component("a", A, binding("<x/>"))), r"of a has neither source nor ParameterSet"),
        (system(""), "holds no FMU"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(make, root: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        ssp.read(make(ssd(root)))


def test_two_sources_for_one_input(make) -> None:
    double = system(TWO, connection("a.y", "b.u"), connection("b.y", "b.u"))
    with pytest.raises(ConnectError, match=r"b.u is already driven by a.y"):
        ssp.read(make(ssd(double)))
    outputs = system(TWO, connection("a.y", "b.y"))
    with pytest.raises(ConnectError, match=r"a.y and b.y are both outputs but connected"):
        ssp.read(make(ssd(outputs)))


def test_bad_files(make, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none.ssp: there is no such file"):
        ssp.read(tmp_path / "none.ssp")
    path = tmp_path / "broken.ssp"
    path.write_text("not a zip archive")
    with pytest.raises(ScenarioError, match=r"broken.ssp: is not a complete SSP archive"):
        ssp.read(path)
    good = ssd(system(component("a", A)))
    for text, message in (
        (good[:200], r"SystemStructure.ssd: cannot be read"),
        (good.replace('version="1.0" name', 'version="3.0" name'), r"is of SSP version 3.0"),
        (good.replace("ssd:SystemStructureDescription", "ssd:System"), r"root element is 'System'"),
    ):
        with pytest.raises(ScenarioError, match=message):
            ssp.read(make(text))
    itself = ssd(
        system(
            component("a", "SystemStructure.ssd", attributes='type="application/x-ssp-definition"')
        )
    )
    with pytest.raises(ScenarioError, match="contains itself as a component"):
        ssp.read(make(itself))
