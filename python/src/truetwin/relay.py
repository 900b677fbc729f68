"""Forwards lines between the program ``truetwin`` and the Python process that holds the simulator.

The program starts ``python relay.py ADDRESS`` as its simulator program. ADDRESS is the path of a Unix socket, or the port of
a local TCP socket; then the environment variable TRUETWIN_RELAY_TOKEN proves that the program's own child connects.
"""

import os
import socket
import sys


def main() -> int:
    """Forwards requests and answers until the program closes standard input."""
    if len(sys.argv) != 2:
        sys.stderr.write("usage: relay.py ADDRESS; truetwin's Python package starts it\n")
        return 2
    address = sys.argv[1]
    try:
        if address.isdecimal():
            connection = socket.create_connection(("127.0.0.1", int(address)))
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.sendall(os.environ["TRUETWIN_RELAY_TOKEN"].encode() + b"\n")
        else:
            connection = socket.socket(socket.AF_UNIX)
            connection.connect(address)
        forward(connection)
    except (OSError, KeyError, EOFError) as error:
        sys.stderr.write(f"no connection to the Python process that holds the simulator: {error!r}\n")
        return 1
    return 0


def forward(connection: socket.socket) -> None:
    """Forwards one line each way in turn: the program sends no request before it has the last answer."""
    while piece := os.read(0, 1 << 16):
        connection.sendall(piece)
        if piece.endswith(b"\n"):
            answer(connection)


def answer(connection: socket.socket) -> None:
    """Forwards one line from the connection to standard output."""
    while piece := connection.recv(1 << 16):
        write(piece)
        if piece.endswith(b"\n"):
            return
    raise EOFError("it has closed the connection")


def write(piece: bytes) -> None:
    """Writes all of a piece to standard output."""
    while piece:
        piece = piece[os.write(1, piece) :]


if __name__ == "__main__":
    sys.exit(main())
