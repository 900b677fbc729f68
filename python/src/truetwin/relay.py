"""Connects the program ``truetwin`` to the Python process that holds the simulator.

The program starts ``python relay.py ADDRESS`` as its simulator program. ADDRESS is the path of a Unix socket: the relay hands its
pipes over, and the other process answers the program directly. Or ADDRESS is the port of a local TCP socket: the relay forwards
lines and the bytes behind them, and the environment variable TRUETWIN_RELAY_TOKEN proves that the program's own child connects.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from typing import BinaryIO


def main() -> int:
    """Serves the program until it closes standard input."""
    if len(sys.argv) != 2:
        sys.stderr.write("usage: relay.py ADDRESS; truetwin's Python package starts it\n")
        return 2
    address = sys.argv[1]
    try:
        if address.isdecimal():
            connection = socket.create_connection(("127.0.0.1", int(address)))
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.sendall(os.environ["TRUETWIN_RELAY_TOKEN"].encode() + b"\n")
            forward(connection)
        else:
            connection = socket.socket(socket.AF_UNIX)
            connection.connect(address)
            hand_over(connection)
    except (OSError, KeyError, EOFError) as error:
        sys.stderr.write(f"no connection to the Python process that holds the simulator: {error!r}\n")
        return 1
    return 0


def hand_over(connection: socket.socket) -> None:
    """Hands standard input and output to the other process, and waits for its word that the program needs no more."""
    socket.send_fds(connection, [b"\n"], [0, 1])
    if not connection.recv(1):
        raise EOFError("it has closed the connection")


def forward(connection: socket.socket) -> None:
    """Forwards one message each way in turn: the program sends no request before it has the last answer."""
    requests, answers = sys.stdin.buffer, connection.makefile("rb")
    while request := message(requests):
        connection.sendall(request)
        answer = message(answers)
        if not answer:
            raise EOFError("it has closed the connection")
        write(answer)


def message(pipe: BinaryIO) -> bytes:
    """Returns a line and the bytes that it announces; nothing at the end."""
    line = pipe.readline()
    return line + pipe.read(json.loads(line).get("bytes", 0)) if line.strip() else line


def write(piece: bytes) -> None:
    """Writes all of a piece to standard output."""
    while piece:
        piece = piece[os.write(1, piece) :]


if __name__ == "__main__":
    sys.exit(main())
