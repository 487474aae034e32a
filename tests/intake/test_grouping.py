"""Files are runs of their own, or parts of one: by their columns and names, and it is said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.errors import InputError
from cosim.intake.grouping import Columns, FilesAre, grouped, without

CMD, POSE = frozenset({"left", "right"}), frozenset({"x", "y", "yaw"})


def by_name(path: Path) -> Columns:
    return POSE if "pose" in path.stem else CMD


def runs(*names: str, files_are: FilesAre = "") -> dict[str, list[str]]:
    found = grouped([Path(f"{name}.csv") for name in names], {}, by_name, files_are)
    return {run: [path.stem for path in paths] for run, paths in found.runs.items()}


def test_numbered_files_with_the_same_columns_are_runs() -> None:
    names = [f"run_{i}" for i in range(1, 6)]
    found = grouped([Path(f"{name}.csv") for name in names], {}, by_name)
    assert list(found.runs) == names and all(len(paths) == 1 for paths in found.runs.values())
    assert "5 runs of one file each, since all have the same columns (run_1, " in found.said
    assert "--files-are parts if they are one run" in found.said
    assert runs(*names, files_are="parts") == {"run": names}
    assert runs("a", "b", files_are="parts") == {"run": ["a", "b"]}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("arc_cmd", "arc_pose", "eight_cmd", "eight_pose"), ("arc", "eight")),
        (("run_1_cmd", "run_1_pose", "run_2_cmd", "run_2_pose"), ("run_1", "run_2")),
        (("cmd_1", "pose_1", "cmd_2", "pose_2"), ("1", "2")),
        (("cmd1", "pose1", "cmd12", "pose12"), ("1", "12")),
        (("bot_cmd_1", "bot_pose_1", "bot_cmd_2", "bot_pose_2"), ("1", "2")),
        (("pose-a1-x", "cmd-a1-x", "pose-a2-x", "cmd-a2-x"), ("1", "2")),
    ],
)
def test_parts_have_different_columns_and_names_that_fit(
    names: Sequence[str], expected: Sequence[str]
) -> None:
    found = runs(*names)
    assert tuple(found) == tuple(expected)
    for run, files in found.items():
        assert len(files) == 2 and {"cmd", "pose"} <= {
            kind for kind in ("cmd", "pose") for file in files if kind in file
        }
        labels = {without(file, run) for file in files}
        assert labels == {without(file, other) for other, also in found.items() for file in also}
    assert list(runs(*names, files_are="runs")) == [n.replace("-", "_") for n in names]


def test_files_of_different_columns_are_one_run() -> None:
    assert runs("arc_cmd", "arc_pose") == {"arc": ["arc_cmd", "arc_pose"]}
    assert runs("wheels", "pose") == {"run": ["wheels", "pose"]}
    found = grouped([Path("arc_cmd.csv"), Path("arc_pose.csv")], {}, by_name)
    assert "the 2 parts of one run" in found.said and "--files-are runs" in found.said


def test_a_column_more_in_one_run_is_the_same_kind() -> None:
    found = grouped(
        [Path("a.csv"), Path("b.csv")], {},
        lambda path: CMD | {"spare"} if path.stem == "a" else CMD,
    )  # fmt: skip
    assert list(found.runs) == ["a", "b"]


def test_a_file_without_its_partner_is_named() -> None:
    with pytest.raises(InputError, match=r"of 2 kinds: arc_cmd\.csv, eight_cmd\.csv \| arc_pose"):
        runs("arc_cmd", "arc_pose", "eight_cmd")
    with pytest.raises(InputError, match=r"run 'eight' would be eight_cmd\.csv\. Name files alike"):
        runs("arc_cmd", "arc_pose", "eight_cmd")


def test_given_runs_are_taken_as_they_are() -> None:
    files = [Path("a_cmd.csv"), Path("a_pose.csv")]
    found = grouped([], {"one": files}, by_name)
    assert found.runs == {"one": files} and found.said == ""
    assert grouped([Path("a.csv")], {}, by_name).said == ""  # one file is one run
    with pytest.raises(InputError, match="there is a run 'a' already"):
        grouped([Path("a.csv"), Path("x/a.csv")], {}, by_name)
    with pytest.raises(InputError, match="there is a run 'a' already"):
        grouped(files, {"a": files}, by_name)
    with pytest.raises(InputError, match="no files to import"):
        grouped([], {}, by_name)


def test_the_command_says_what_it_took_the_files_for(tmp_path: Path) -> None:
    files = []
    for number in (1, 2):
        path = tmp_path / f"run_{number}.csv"
        path.write_text("t,u_v,w_rpm\n" + "".join(f"{i / 50},{i % 7},{i}\n" for i in range(50)))
        files.append(str(path))
    args = ["data", "import", *files, "--system", "motor_bench", "--out", str(tmp_path / "set")]
    said = CliRunner().invoke(app, args).stderr
    assert "note: the files are taken for 2 runs of one file each" in said
    said = CliRunner().invoke(app, [*args, "--files-are", "parts"]).stderr
    assert "taken for" not in said and "there is one run only" in said
