"""Where lines come from: standard input, a file that may grow, a serial device, UDP datagrams.

A source yields lines, and None whenever nothing came for a moment, so that whoever reads can stop.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

PAUSE = 0.1
"""s after which a source without lines says so."""
BLOCK = 65536
"""bytes read at a time"""
LARGEST_PORT = 65535


def lines_of(
    source: str = "-", *, udp: int | None = None, follow: bool = False, baud: int = 115200
) -> Iterator[str | None]:
    """Lines of a source; those of UDP and of a followed file never end.

    Args:
        source: ``-`` for standard input; a file, named pipe, pseudo-terminal or serial device.
        udp: instead, the port on which datagrams of one or several lines arrive.
        follow: wait for more at the end of a file.
        baud: rate of a serial device.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the port or the baud rate is none.
    """
    if udp is not None:
        return datagrams(udp)
    if source == "-":
        return read_lines(sys.stdin.fileno(), follow=False)
    return file_lines(Path(source), follow, baud)


def check_port(port: int) -> int:
    """A port number.

    Raises:
        ValueError: it is none.
    """
    if not 0 <= port <= LARGEST_PORT:
        raise ValueError(f"a port must be a number from 0 to {LARGEST_PORT}, got {port}")
    return port


def datagrams(port: int) -> Iterator[str | None]:
    """Lines of the datagrams that arrive on a UDP port."""
    check_port(port)
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        receiver.bind(("0.0.0.0", port))
    except OSError as reason:
        receiver.close()
        raise OSError(reason.errno, reason.strerror, f"UDP port {port}") from None
    receiver.settimeout(PAUSE)
    return _received(receiver)


def _received(receiver: socket.socket) -> Iterator[str | None]:
    with closing(receiver):
        while True:
            try:
                content = receiver.recv(BLOCK)
            except TimeoutError:
                yield None
                continue
            yield from content.decode("utf-8", errors="replace").splitlines()


def file_lines(path: Path, follow: bool, baud: int) -> Iterator[str | None]:
    """Lines of a file or device."""
    if os.path.isdir(path):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOCTTY", 0))
    if os.isatty(descriptor):
        try:
            make_raw(descriptor, baud)
        except ValueError:
            os.close(descriptor)
            raise
    return _closed_after(descriptor, follow)


def _closed_after(descriptor: int, follow: bool) -> Iterator[str | None]:
    try:
        yield from read_lines(descriptor, follow)
    finally:
        os.close(descriptor)


def make_raw(descriptor: int, baud: int) -> None:
    """Set a serial device to its rate, without echo and without changing characters.

    Raises:
        ValueError: the device has no such rate.
    """
    import termios
    import tty

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        known = sorted(int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit() and name != "B0")
        raise ValueError(f"baud must be one of {known}, got {baud}")
    tty.setraw(descriptor)
    attributes = termios.tcgetattr(descriptor)
    attributes[4] = attributes[5] = speed
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def read_lines(descriptor: int, follow: bool) -> Iterator[str | None]:
    """Lines of an open file; a line counts when its end has come, the last one also at the end of the file."""
    regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
    rest = b""
    while True:
        if not regular and not select.select([descriptor], [], [], PAUSE)[0]:
            yield None
            continue
        try:
            content = os.read(descriptor, BLOCK)
        except OSError as reason:
            if reason.errno != errno.EIO:  # the other end of a pseudo-terminal was closed
                raise
            content = b""
        if not content:
            if not (follow and regular):
                break
            yield None
            time.sleep(PAUSE)
            continue
        *whole, rest = (rest + content).split(b"\n")
        for line in whole:
            yield line.decode("utf-8", errors="replace")
    if rest.strip():
        yield rest.decode("utf-8", errors="replace")
