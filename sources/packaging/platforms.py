"""The platforms that FMUs are built for."""

from __future__ import annotations

import platform
from dataclasses import dataclass


@dataclass(frozen=True)
class Platform:
    """A target platform.

    Attributes:
        target: zig's target triple; glibc 2.17 and macOS 11 are the oldest systems served.
        suffix: of the shared library.
        fmi2, fmi3: folder names below `binaries/`.
    """

    target: str
    suffix: str
    fmi2: str
    fmi3: str


PLATFORMS: dict[str, Platform] = {
    "x86_64-linux": Platform("x86_64-linux-gnu.2.17", ".so", "linux64", "x86_64-linux"),
    "aarch64-linux": Platform("aarch64-linux-gnu.2.17", ".so", "aarch64-linux", "aarch64-linux"),
    "x86_64-windows": Platform("x86_64-windows-gnu", ".dll", "win64", "x86_64-windows"),
    "x86_64-darwin": Platform("x86_64-macos.11.0", ".dylib", "darwin64", "x86_64-darwin"),
    "aarch64-darwin": Platform("aarch64-macos.11.0", ".dylib", "aarch64-darwin", "aarch64-darwin"),
}


def host_platform() -> str:
    """This machine's entry of `PLATFORMS`.

    Raises:
        ValueError: no FMU can be built for this machine.
    """
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    name = f"{machine}-{platform.system().lower()}"
    if name not in PLATFORMS:
        raise ValueError(f"no FMUs for {name}; there are {', '.join(PLATFORMS)}")
    return name
