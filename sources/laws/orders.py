"""Cycles per revolution that machines have: poles, slots, teeth, and what they make together."""

ORDERS = tuple(
    float(n)
    for n in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 15, 16, 18, 20, 21, 22, 24, 28, 30, 32, 36, 40,
              42, 48)
)  # fmt: skip
