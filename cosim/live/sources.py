"""Where lines come from: files, standard input, TCP, UDP, MQTT.

| address | lines |
|---|---|
| `log.jsonl`, `-` | of a file, of standard input |
| `tcp://HOST:PORT`, `tcp://:PORT` | of a server; of those who connect to this port, in turn |
| `udp://:PORT`, `udp://HOST:PORT` | of datagrams to this port (and address) |
| `mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC` | of messages on a topic; needs paho-mqtt |

A thread reads and notes when each line came; the address decides nothing else.
"""

from __future__ import annotations

import contextlib
import queue
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from ..errors import CosimError, InputError, listing
from ..spec.distribution import needed

Line = tuple[float, bytes]
"""Arrival by `time.monotonic` [s], and the line."""
Put = Callable[[bytes], None]
SCHEMES = ("tcp", "udp", "mqtt")
LONGEST = 1 << 20
"""Bytes of a line: what is longer is no message."""
BACKLOG = 1 << 16
"""Lines that wait; a file waits for its reader then, and a socket's sender for the network."""
POLL = 0.2
"""How often a reader looks whether it shall stop [s]."""
MQTT_PORT = 1883


class Source:
    """Lines from an address, read by a thread of its own.

    Args:
        address: see the module.

    Raises:
        InputError: no such address, or it cannot be opened.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._queue: queue.Queue[Line | BaseException | None] = queue.Queue(BACKLOG)
        self._stop = threading.Event()
        scheme, found, _ = address.partition("://")
        if found and scheme not in SCHEMES:
            raise InputError(f"--source {address}: {listing(SCHEMES, scheme)} as kind of address")
        self.recorded = not found and address != "-"
        """Whether all lines are there already, so that a pace can be set."""
        reader = {"tcp": _tcp, "udp": _udp, "mqtt": _mqtt}[scheme] if found else _file
        try:
            run = reader(address, self._put, self._stop)
        except OSError as error:
            raise InputError(f"--source {address}: {error}") from error
        self._thread = threading.Thread(target=self._read, args=(run,), daemon=True)
        self._thread.start()

    def _put(self, line: bytes) -> None:
        while not self._stop.is_set():
            try:
                self._queue.put((time.monotonic(), line), timeout=POLL)
            except queue.Full:
                continue
            return

    def _read(self, run: Callable[[], None]) -> None:
        try:
            run()
        except (OSError, CosimError) as error:
            self._queue.put(error)
        else:
            self._queue.put(None)

    def lines(self, timeout: float, most: int) -> list[Line] | None:
        """Lines that have come, after waiting for the first one; None behind the last.

        Args:
            timeout: how long to wait [s].
            most: how many at once.

        Raises:
            CosimError: the source broke off.
        """
        found: list[Line] = []
        while len(found) < most:
            try:
                item = self._queue.get(block=not found, timeout=timeout)
            except queue.Empty:
                break
            if item is None or isinstance(item, BaseException):
                if found:
                    self._queue.put(item)  # for the next call
                    break
                if isinstance(item, BaseException):
                    raise CosimError(f"--source {self.address}: {item}") from item
                return None
            found.append(item)
        return found

    def close(self) -> None:
        """Stop reading."""
        self._stop.set()


def _split(stream: Callable[[int], bytes], put: Put, stop: threading.Event) -> None:
    """Lines of a stream of bytes; waiting for bytes may time out."""
    rest = b""
    while not stop.is_set():
        try:
            content = stream(1 << 16)
        except TimeoutError:
            continue
        *lines, rest = (rest + content).split(b"\n")
        for line in lines:
            if line.strip():
                put(line)
        if not content:
            break
        if len(rest) > LONGEST:
            rest = b""
            put(b"(a line that does not end)")
    if rest.strip():
        put(rest)


def _file(address: str, put: Put, stop: threading.Event) -> Callable[[], None]:
    if address != "-" and not Path(address).is_file():
        raise InputError(f"--source {address}: there is no such file")

    def run() -> None:
        if address == "-":
            _split(sys.stdin.buffer.read1, put, stop)  # type: ignore[union-attr]
            return
        with Path(address).open("rb") as handle:
            _split(handle.read, put, stop)

    return run


def _place(address: str) -> tuple[str, int]:
    """Host and port of an address.

    Raises:
        InputError: no port.
    """
    parts = urlsplit(address)
    try:
        port = parts.port
    except ValueError:
        port = None
    if port is None:
        raise InputError(f"--source {address}: has no port; write {parts.scheme}://HOST:PORT")
    return parts.hostname or "", port


def _tcp(address: str, put: Put, stop: threading.Event) -> Callable[[], None]:
    host, port = _place(address)
    if host:
        peer = socket.create_connection((host, port), timeout=10.0)
        peer.settimeout(POLL)

        def run() -> None:
            with peer:
                _split(peer.recv, put, stop)

        return run
    server = socket.create_server(("", port))
    server.settimeout(POLL)

    def serve() -> None:
        with server:
            for connection in _accepted(server, stop):
                # one that breaks off has ended, and the next one may come
                with connection, contextlib.suppress(ConnectionError):
                    connection.settimeout(POLL)
                    _split(connection.recv, put, stop)

    return serve


def _accepted(server: socket.socket, stop: threading.Event) -> Iterator[socket.socket]:
    while not stop.is_set():
        try:
            yield server.accept()[0]
        except TimeoutError:
            continue


def _udp(address: str, put: Put, stop: threading.Event) -> Callable[[], None]:
    place = _place(address)
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    peer.bind(place)
    peer.settimeout(POLL)

    def run() -> None:
        with peer:
            while not stop.is_set():
                try:
                    content = peer.recv(1 << 16)
                except TimeoutError:
                    continue
                for line in content.split(b"\n"):
                    if line.strip():
                        put(line)

    return run


def _mqtt(address: str, put: Put, stop: threading.Event) -> Callable[[], None]:
    mqtt = needed("paho.mqtt.client", f"--source {address}", "live")
    parts = urlsplit(address)
    topic = unquote(parts.path.lstrip("/"))
    if not parts.hostname or not topic:
        raise InputError(f"--source {address}: lacks a host or a topic; write mqtt://HOST/TOPIC")
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    if parts.username:
        client.username_pw_set(unquote(parts.username), unquote(parts.password or ""))
    refused: list[str] = []

    def connected(client: Any, _user: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            refused.append(str(reason))
        else:  # after a reconnection, too
            client.subscribe(topic, qos=1)

    def arrived(_client: Any, _user: Any, message: Any) -> None:
        for line in message.payload.split(b"\n"):
            if line.strip():
                put(line)

    client.on_connect, client.on_message = connected, arrived
    client.connect(parts.hostname, parts.port or MQTT_PORT)

    def run() -> None:
        client.loop_start()
        try:
            while not stop.wait(POLL):
                if refused:
                    raise InputError(f"the broker refused: {refused[0]}")
        finally:
            client.disconnect()
            client.loop_stop()

    return run
