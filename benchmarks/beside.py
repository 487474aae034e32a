"""Twins beside streaming machines: false alarms in an hour, delays of alarms, lateness at a broker.

    python -m benchmarks.beside hour             clean hour of the motor bench, 1 kHz, unpaced
    python -m benchmarks.beside effects          friction, late commands switched on: alarm when
    python -m benchmarks.beside broker --minutes 5       through mosquitto at real time

The machine is the model of `scenarios/motor_bench` with the noise of its sheet; set speeds change
every half second. In `broker` a process of its own publishes each sample when it is due.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import Machine
from cosim.live.reading import Reading, read_reading
from cosim.live.sources import Source
from cosim.live.watch import Settings, Watch

ENTRIES = {"initial_motor_angle": 0.0}
STRENGTHS = (0.01, 0.02, 0.05, 0.1)
"""Dry friction at the load's flange [N.m]; the bench's viscous friction is 0.2 N.m at 3 rad/s."""
DELAYS = (0.001, 0.002, 0.005, 0.02)
"""By which commands begin to act later [s]; a sample is 1 ms."""
BEGIN = 20.0
"""When they are switched on [s]."""
PORT, TOPIC = 18831, "bench"


def machine(reading: Reading, seconds: float, seed: int, **how: Any) -> Machine:
    """The bench, whose set speed changes every half second."""
    count = round(seconds / reading.interval)
    held = round(0.5 / reading.interval)
    speeds = np.random.default_rng(seed).uniform(-40.0, 40.0, count // held + 1)
    commands = {"speed_set": np.repeat(speeds, held)[:count]}
    return Machine(reading, commands, ENTRIES, seed=seed, **how)


def watched(reading: Reading, source: Machine) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Summary and events of a twin beside a machine, as fast as possible."""
    events: list[dict[str, Any]] = []
    watch = Watch(reading, Settings(pace=0.0, report=60.0), events.append)
    for number, block in enumerate(source.lines()):
        watch.take([(0.0, line) for line in block])
        if number % 300 == 299:  # ten minutes at 1 kHz
            print(f"{watch.counts.samples} samples, alarms: {watch.raised}", file=sys.stderr)
    watch.finish()
    return watch.summary(), events


def hour(reading: Reading, minutes: float) -> None:
    """False alarms in clean data."""
    begun = time.perf_counter()
    summary, _ = watched(reading, machine(reading, 60.0 * minutes, 1))
    print(json.dumps({"minutes": minutes, "wall_s": time.perf_counter() - begun, **summary}))


def effects(reading: Reading) -> None:
    """Alarm delays for friction, and for late commands, that begin in the middle of a run."""
    friction = {"variant": {"load": "+coulomb"}, "values": {"load.coulomb.tau_c": 0.0}}
    cases: list[tuple[dict[str, float], dict[str, Any]]] = [
        *(({"tau_c_Nm": size}, {**friction, "change": {BEGIN: {"load.coulomb.tau_c": size}}})
          for size in STRENGTHS),
        *(({"late_s": delay}, {"late": (BEGIN, delay)}) for delay in DELAYS),
    ]  # fmt: skip
    for what, how in cases:
        _, events = watched(reading, machine(reading, 3.0 * BEGIN, 2, **how))
        alarms = [event for event in events if event.get("event") == "alarm"]
        first = min(alarms, key=lambda alarm: alarm["t"], default=None)
        after = None if first is None else round(first["t"] - BEGIN, 3)
        print(json.dumps({**what, "alarm_after_s": after, "first": first}))


def broker(reading: Reading, minutes: float) -> None:
    """Lateness behind mosquitto at real time."""
    program = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "broker.conf"
        config.write_text(
            f"listener {PORT} 127.0.0.1\nallow_anonymous true\nmax_queued_messages 0\n"
        )
        command = [sys.executable, "-m", "benchmarks.beside", "publish", "--minutes", str(minutes)]
        server = subprocess.Popen([program, "-c", str(config)], stderr=subprocess.DEVNULL)
        publisher = subprocess.Popen(command)
        try:
            time.sleep(1.0)
            source = Source(f"mqtt://127.0.0.1:{PORT}/{TOPIC}")
            settings = Settings(pace=1.0, report=30.0, idle=600.0)
            Watch(reading, settings, lambda event: print(json.dumps(event), flush=True)).follow(
                source
            )
            publisher.wait()
        finally:
            publisher.kill()
            server.terminate()
            server.wait()


def publish(reading: Reading, minutes: float) -> None:
    """Publish each sample when it is due."""
    from paho.mqtt import client as mqtt

    lines = [line for block in machine(reading, 60.0 * minutes, 3).lines() for line in block]
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", PORT)
    client.loop_start()
    begun = time.monotonic()
    for number, line in enumerate(lines):
        delay = begun + number * reading.interval - time.monotonic()
        if delay > 0.0:
            time.sleep(delay)
        client.publish(TOPIC, line, qos=1)
    client.publish(TOPIC, b'{"end": true}', qos=1).wait_for_publish(60.0)
    client.disconnect()
    client.loop_stop()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.beside")
    parser.add_argument("what", choices=["hour", "effects", "broker", "publish"])
    parser.add_argument("--minutes", type=float)
    given = parser.parse_args(arguments)
    reading = read_reading("motor_bench")
    if given.what == "effects":
        effects(reading)
    elif given.what == "hour":
        hour(reading, given.minutes or 60.0)
    else:
        {"broker": broker, "publish": publish}[given.what](reading, given.minutes or 5.0)


if __name__ == "__main__":
    main()
