"""One individual of a rig with laws that its sheet does not declare."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Law:
    """An undeclared law: its name in the plant, its size, and its shape where it has one."""

    name: str
    size: float
    shape: float = 0.0


@dataclass(frozen=True)
class Bench:
    """One individual: its parameters, and its undeclared laws, of which the first stands apart."""

    parameters: dict[str, float]
    effect: str = "none"
    size: float = 0.0
    shape: float = 0.0
    others: tuple[Law, ...] = ()

    @property
    def laws(self) -> tuple[Law, ...]:
        """All of them; a clean individual has none."""
        first = () if self.effect == "none" else (Law(self.effect, self.size, self.shape),)
        return (*first, *self.others)

    def of(self, name: str) -> float:
        """Size of one of its laws, 0 of one that it does not have."""
        return sum(law.size for law in self.laws if law.name == name)

    def form(self, name: str, usual: dict[str, float]) -> float:
        """Shape of one of its laws, the usual one where none was drawn."""
        drawn = [law.shape for law in self.laws if law.name == name and law.shape]
        return drawn[0] if drawn else usual.get(name, 0.0)

    def alone(self) -> list[Bench]:
        """The individual with each of its laws alone, itself if it has none."""
        laws = self.laws or (Law("none", 0.0),)
        return [Bench(self.parameters, law.name, law.size, law.shape) for law in laws]
