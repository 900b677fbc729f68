"""Answers the program's requests for simulations: the relays that it starts connect to this process."""

from __future__ import annotations

import os
import secrets
import shlex
import shutil
import socket
import sys
import tempfile
import threading
from pathlib import Path
from types import TracebackType

from . import relay
from ._errors import TruetwinError
from ._points import PointModel
from ._simulator import Model

#: Longest path of a Unix socket on every system that has them.
LONGEST_PATH = 100
#: Bytes that are read at once.
PIECE = 1 << 16


class Server:
    """Serves a model while it is open: one thread for each relay.

    A Unix socket in a folder that only this user can enter; without Unix sockets, a local TCP socket and a random token.
    """

    def __init__(self, model: Model | PointModel) -> None:
        if not sys.executable:
            raise TruetwinError("sys.executable is empty: this Python cannot start another one; use a Python with an executable")
        self._model = model
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._closed = False
        #: Folder of the socket; None for one of TCP.
        self.folder: str | None = None
        self._token: str | None = None
        if hasattr(socket, "AF_UNIX"):
            self.folder = _short_folder()
            address = os.path.join(self.folder, "relay")
            self._listener = socket.socket(socket.AF_UNIX)
            self._listener.bind(address)
        else:
            self._token = secrets.token_hex(32)
            self._listener = socket.create_server(("127.0.0.1", 0))
            address = str(self._listener.getsockname()[1])
        self._listener.listen(64)
        # Not every system wakes a thread that waits for a connection when the socket is closed.
        self._listener.settimeout(0.5)
        # Isolated and without site-packages: the relay starts fast, and sees nothing of this process's paths.
        words = [sys.executable, "-I", "-S", str(Path(relay.__file__).resolve()), address]
        #: The value of ``--program``.
        self.command = shlex.join(words)
        #: Environment of the program and so of its relays.
        self.environment = {"TRUETWIN_RELAY_TOKEN": self._token} if self._token else {}
        threading.Thread(target=self._accept, name="truetwin-accept", daemon=True).start()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close all connections; relays that still run end."""
        with self._lock:
            self._closed = True
            connections = [self._listener, *self._open]
        for connection in connections:
            try:
                # Wakes the thread that waits for it.
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
            connection.close()
        if self.folder:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
                connection.settimeout(None)
            except TimeoutError:
                continue
            except OSError:
                return
            with self._lock:
                if self._closed:
                    connection.close()
                    return
                self._open.add(connection)
            threading.Thread(target=self._serve, args=(connection,), name="truetwin-simulator", daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            if self._token is None:
                self._serve_pipes(connection)
            else:
                self._serve_lines(connection)
        except OSError:
            pass  # The program has ended its relay.
        finally:
            with self._lock:
                self._open.discard(connection)
            connection.close()

    def _serve_pipes(self, connection: socket.socket) -> None:
        """Answer on the pipes of the relay, which takes no part: a tenth of a millisecond less per run."""
        _, pipes, _, _ = socket.recv_fds(connection, 1, 2)
        for pipe in pipes:
            os.set_inheritable(pipe, False)
        if len(pipes) != 2:
            return
        with os.fdopen(pipes[0], "rb", PIECE) as requests, os.fdopen(pipes[1], "wb", 0) as answers:
            for line in requests:
                left = memoryview(self._model.answer(line, requests.read))
                while left:
                    left = left[answers.write(left) :]
        connection.sendall(b"\n")

    def _serve_lines(self, connection: socket.socket) -> None:
        """Answer on a connection that proves itself."""
        with connection.makefile("rb", buffering=PIECE) as lines:
            if not self._proved(lines.readline(256)):
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for line in lines:
                connection.sendall(self._model.answer(line, lines.read))

    def _proved(self, line: bytes) -> bool:
        return self._token is not None and secrets.compare_digest(line.strip(), self._token.encode())


def _short_folder() -> str:
    """Return a new private folder whose path is short enough for a socket."""
    folder = tempfile.mkdtemp(prefix="truetwin-")
    if len(os.fsencode(folder)) + len("/relay") > LONGEST_PATH:
        os.rmdir(folder)
        folder = tempfile.mkdtemp(prefix="truetwin-", dir="/tmp")
    return folder
