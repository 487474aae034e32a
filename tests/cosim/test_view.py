"""Pages in 3D: bodies stand where the FMUs say, and the page asks nobody for anything."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim.calibrate import Simulator, read_problem
from cosim.calibrate.replay import replay
from cosim.data.comparison import Reference
from cosim.data.recording import Recording
from cosim.errors import FmuFileError, ValueRangeError
from cosim.fmu.archive import open_fmu
from cosim.fmu.metadata import parse_metadata
from cosim.spec import scene
from cosim.view.page import content, view_page, write_view
from sources.scene import component_scene
from sources.variant import components, device_values, fidelities
from tests.fmus import fmu

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
SHOWN = [name for name in components() if component_scene(name)]
SETS = Path(__file__).parents[2] / "scenarios"
RECORDED = 5e-6
"""Of positions in a page [m]: single precision, 6e-8 of some metres, through a chain of 14."""


def turned(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    found = np.eye(4)
    found[i, i] = found[j, j] = c
    found[j, i], found[i, j] = s, -s
    return found


def motion(item: dict[str, Any], number) -> np.ndarray:
    found = np.eye(4)
    if "move" in item:
        found[:3, 3] = [number(part) for part in item["move"]]
    elif "turn" in item:
        found = turned(item["turn"], number(item["by"]))
    else:
        w, *v = (number(part) for part in item["quaternion"])
        cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        found[:3, :3] += 2.0 * w * cross + 2.0 * cross @ cross
    return found


def number(now: np.ndarray, item: Any) -> float:
    """A number of a page: itself, or in a channel."""
    return float(now[item[0]]) if isinstance(item, list) else item


def paths(page: dict[str, Any]) -> dict[str, np.ndarray]:
    """World positions of all nodes over the frames."""
    count = len(page["times"])
    samples = np.frombuffer(base64.b64decode(page["samples"]), dtype="<f4").reshape(-1, count)
    found: dict[str, list[np.ndarray]] = {}
    for frame in range(count):
        poses: list[np.ndarray] = []
        for node in page["nodes"]:
            pose = poses[node["parent"]] if node["parent"] >= 0 else np.eye(4)
            for item in node["pose"]:
                pose = pose @ motion(item, partial(number, samples[:, frame]))
            poses.append(pose)
            key = node["name"] + (" measured" if node.get("measured") else "")
            found.setdefault(key, []).append(pose[:3, 3])
    return {name: np.array(items) for name, items in found.items()}


@pytest.fixture(scope="module")
def turns() -> Recording:
    return cosim.run("crawler_paper/SET1_1", duration=2.0).recording


@pytest.mark.parametrize("name", SHOWN)
def test_every_scene_is_one(name: str) -> None:
    assert scene.problem(component_scene(name)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOWN)
def test_every_name_in_a_scene_is_a_variable_of_some_fidelity(name: str) -> None:
    """What no fidelity has would be left out everywhere, without a word."""
    known = {f"{n}[{i}]" for n, o in device_values(name, components()[name].device).items()
             if isinstance(o.value, (list, tuple)) for i in range(1, len(o.value) + 1)}  # fmt: skip
    for fidelity in fidelities(name):
        known |= set(open_fmu(fmu(f"{name}/{fidelity}")).description.variables)
    items = [[node["pose"], node["shapes"]] for node in component_scene(name)]
    used = {n for formula in scene.formulas(items) for n in scene.names(formula)}
    assert used - known == set()


@pytest.mark.slow
def test_the_drawn_arm_ends_where_its_fmu_says_the_tool_is() -> None:
    recording = cosim.run("mobile_manipulator/IY", duration=3.0).recording
    found = paths(content(recording, (), ()))
    assert np.abs(found["arm: tool"] - recording["arm.tool_position"]).max() < RECORDED
    assert np.ptp(found["arm: tool"], axis=0).max() > 0.1  # it moved
    mount = found["arm: mount"] - found["base: body"]
    assert np.abs(np.linalg.norm(mount, axis=1) - np.linalg.norm(mount[0])).max() < RECORDED


@pytest.mark.slow
def test_drawn_wheels_of_the_omnidirectional_base_do_not_slip() -> None:
    recording = cosim.run("omni_base/open", duration=4.0).recording
    page = content(recording, (), ())
    found, times = paths(page), np.array(page["times"])
    headings = recording["base.theta"][:, None] + recording["base.beta"]
    rows = np.searchsorted(recording.time, times - 1e-9)
    for i in (1, 2, 3):
        place = found[f"base: wheel {i}"][:, :2]
        velocity = np.gradient(place, times, axis=0)
        angle = headings[rows, i - 1]
        across = velocity @ np.eye(2)
        lateral = -np.sin(angle) * across[:, 0] + np.cos(angle) * across[:, 1]
        forward = np.cos(angle) * velocity[:, 0] + np.sin(angle) * velocity[:, 1]
        rolled = -0.1 * np.gradient(recording["base.phi"][rows, i - 1], times)
        # differences over two frames: single precision over 5 ms is 5e-5 m/s, curvature less
        assert np.abs(lateral[2:-2]).max() < 2e-3
        assert np.abs(forward - rolled)[2:-2].max() < 2e-3
        assert np.abs(forward).max() > 0.1


def test_what_is_measured_stands_beside_the_model(turns) -> None:
    shifted = turns["own.x_S"] + 0.05
    reference = Reference(("own.x_S",), turns.time, shifted[:, None], "m", "a test")
    page = content(turns, [reference], ())
    found = paths(page)
    gap = found["own: S measured"] - found["own: S"]
    assert np.abs(gap - [0.05, 0.0, 0.0]).max() < RECORDED
    shown = {node["name"] for node in page["nodes"] if node.get("measured") and node["shapes"]}
    assert shown == {"own: S"}  # the body is placed by x and y, of which nothing was measured
    assert "measured" in next(s for s in page["signals"] if s["name"] == "own.x_S")


def test_without_measurement_there_is_no_ghost(turns) -> None:
    page = content(turns, (), ())
    assert not any(node.get("measured") for node in page["nodes"])
    assert not any("measured" in signal for signal in page["signals"])


def test_a_page_needs_no_network(turns, tmp_path: Path) -> None:
    page = write_view(tmp_path / "view.html", turns, title="</script><b>").read_text()
    assert not re.search(r"https?:|//[a-z]+\.|src=|href=|@import|fetch\(|XMLHttp|url\(", page)
    assert "<b>" not in page.split("<footer>")[0].split("</title>")[1]
    found = json.loads(page.split('type="application/json">')[1].split("</script>")[0])
    assert found["times"][-1] == 2.0


def test_a_recording_without_a_scene_is_refused(turns) -> None:
    bare = Recording(turns.time, turns.values, turns.names, turns.units)
    with pytest.raises(ValueRangeError, match=r"nothing in this recording has a scene.*view.md"):
        view_page(bare)


def test_a_twin_is_shown_too() -> None:
    with cosim.open("crawler_paper/SET1_1") as twin:
        twin.step(0.5)
        assert "own: body" in view_page(twin.recording)


@pytest.mark.parametrize(
    ("nodes", "text"),
    [
        ([{"name": "a", "parent": "b"}], "its parent 'b' is no node before it"),
        ([{"name": "a", "pose": [{"turn": "w", "by": 1}]}], "must turn about x, y or z"),
        ([{"name": "a", "shapes": [{"box": [1, 2]}]}], r"box takes 3 numbers, not \[1, 2\]"),
        ([{"name": "a", "shapes": [{"ball": 1}]}], "is not one of box, cylinder"),
        ([{"name": "a", "shapes": [{"sphere": "__import__('os')"}]}], "is no formula"),
        ([{"name": "a", "shapes": [{"sphere": "(" * 150}]}], "is no formula"),
        ([{"name": "a", "shapes": [{"sphere": 1, "colour": "url(x)"}]}], "is not like #8ac"),
        ("a", "scene is not a list"),
    ],
)
def test_a_foreign_scene_with_a_mistake_is_refused(nodes, text) -> None:
    with pytest.raises(FmuFileError, match=text):
        parse_metadata(json.dumps({"scene": nodes}).encode(), "foreign.fmu")


def test_a_foreign_scene_may_be_all_that_an_fmu_says() -> None:
    nodes = [{"name": "a", "pose": [{"move": ["x", "-0.5*arm.l[2]", 0]}]}]
    assert parse_metadata(json.dumps({"scene": nodes}).encode(), "foreign.fmu")["scene"] == nodes


def test_formulas() -> None:
    values = {"q[1]": 0.5, "caster.r": 2.0}
    assert scene.evaluate("-q[1]*2+sin(0)/caster.r", values.__getitem__) == -1.0
    assert scene.names("cos(q[1]) + caster.r - 1") == ["q[1]", "caster.r"]


def test_what_names_a_missing_variable_is_left_out() -> None:
    nodes = [
        {"name": "a", "pose": [{"move": [0, 0, "z"]}, {"move": ["x", 0, "l"]}], "shapes": []},
        {"name": "b", "parent": "a", "shapes": [{"sphere": "r"}, {"sphere": "l"}]},
        {"name": "c", "parent": "a", "shapes": [{"sphere": "r"}]},
    ]
    found = scene.fitted(nodes, {"x"}.__contains__, {"l": 3.0})
    assert [node["name"] for node in found] == ["a", "b"]
    assert found[0]["pose"] == [{"move": ["x", 0.0, 3.0]}]
    assert found[1]["shapes"] == [{"sphere": 3.0}]


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no chromium or google-chrome on this machine")
def test_a_browser_shows_it_without_an_error(turns, tmp_path: Path) -> None:
    page, picture = write_view(tmp_path / "view.html", turns), tmp_path / "view.png"
    done = subprocess.run(
        [
            str(BROWSER), "--headless=new", "--no-sandbox", "--use-gl=angle",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-logging=stderr",
            f"--user-data-dir={tmp_path / 'profile'}", "--window-size=900,600",
            "--virtual-time-budget=2000", f"--screenshot={picture}", f"{page.as_uri()}#t=1",
        ],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    import matplotlib.image

    pixels = matplotlib.image.imread(picture)[40:540, :600, :3]
    saturated = pixels.max(axis=2) - pixels.min(axis=2) > 0.15
    assert saturated.mean() > 0.01  # coloured bodies, not a grey page


@pytest.mark.slow
def test_a_measured_run_stands_beside_its_model(tmp_path: Path) -> None:
    problem = read_problem(SETS / "omni_bench/data/OB-06")
    run = problem.run("STR")
    recording, references = replay(problem, problem.nominal, run)
    found = paths(content(recording, references, ()))
    gap = found["camera: pose measured"] - found["camera: pose"]
    assert "base: wheel 3" in found
    assert "base: wheel 3 measured" not in found
    # the same model as in a calibration, whose residual this is
    simulated = Simulator(problem, workers=1).simulate(problem.nominal, run)
    column = [channel.signal for channel in problem.channels].index("camera.x_meas")
    assert np.abs(gap[:, 0] - (run.data - simulated)[:, column]).max() < RECORDED


@pytest.mark.slow
def test_a_run_of_a_set_is_named_in_the_path() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "cosim", "view", str(SETS / "omni_bench/data/OB-06")],
        capture_output=True, text=True, cwd=SETS.parent,
    )  # fmt: skip
    assert done.returncode == 2
    assert "has 8 runs; add one to the path: there is STR" in done.stderr


@pytest.mark.slow
def test_a_run_is_shown_from_the_shell(turns, tmp_path: Path) -> None:
    turns.write_parquet(tmp_path / "SET1_1" / "recording.parquet")
    done = subprocess.run(
        [sys.executable, "-m", "cosim", "view", str(tmp_path), "--json"],
        capture_output=True, text=True, cwd=SETS.parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    page = Path(json.loads(done.stdout)["page"])
    assert page == tmp_path / "SET1_1" / "view.html"
    assert "own, measured" in page.read_text()  # of the scenario that the recording names
