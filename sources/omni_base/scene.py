"""Round platform on three wheel sets that steer and roll; its height is drawn freely."""

from __future__ import annotations

from ..scene import ACCENT, BODY, DARK, box, cylinder, move, node, turn, wheel

SCENE = [
    node(
        "platform",
        [move("x", "y"), turn("z", "theta")],
        [
            {"cylinder": ["l_A+0.08", 0.05], "axis": "z", "at": [0, 0, "2.4*r[1]"], "colour": BODY,
             "opacity": 0.6},
            box(0.1, 0.03, 0.055, ("l_A+0.02", 0, "2.4*r[1]"), ACCENT),
            {"frame": 0.3},
        ],
        trail=True,
    ),
    *(
        item
        for i in (1, 2, 3)
        for item in (
            node(
                f"fork {i}",
                [move(f"l_A*cos(alpha_A[{i}])", f"l_A*sin(alpha_A[{i}])", f"r[{i}]"),
                 turn("z", f"beta[{i}]")],
                [cylinder(0.035, f"1.2*r[{i}]", "z", (0, 0, f"0.8*r[{i}]"), DARK),
                 box(f"e[{i}]+0.03", 0.03, 0.02, (f"-0.5*e[{i}]", 0, f"1.1*r[{i}]"), DARK)],
                "platform",
            ),
            node(f"wheel {i}", [move(f"-e[{i}]"), turn("y", f"-phi[{i}]")],
                 wheel(f"r[{i}]", 0.045), f"fork {i}"),
        )
    ),
]  # fmt: skip
