"""The server of the page: where it listens, and who is told of it."""

import errno
import os
import socket
import sys
import webbrowser

from rich.console import Console

from fingergait._core import ConfigError

PORT = 8080
HOST = "127.0.0.1"
_TRIED = 50  # ports

try:
    import rich
    import viser
except ImportError as error:  # the extra is not installed
    missing: ImportError | None = error
else:
    missing = None


def require() -> None:
    """Refuses to go on without the packages of the page."""
    if missing is not None:
        raise ConfigError(
            f"live page: expected the package {missing.name}, found none; install it: pip install 'fingergait[view]'"
        )


def open_server(title: str, host: str = HOST, port: int = PORT, show: bool = True) -> "viser.ViserServer":
    """A server that listens, its address printed on standard error, and opened in a browser where there is a desktop.

    Parameters
    ----------
    title
        Over the controls of the page.
    host, port
        Where to listen; the next free port where that one is taken.
    show
        Open the page where there is a desktop.
    """
    require()
    notes = Console(stderr=True, highlight=False)
    rich.reconfigure(quiet=True)  # the server's own banner: standard output is for results
    free = _free_port(host, port)
    if free != port:
        notes.print(f"port {port} is in use; taking {free}", style="yellow")
    if not _local(host):
        notes.print(
            f"warning: the page listens on {host}: everyone who reaches this machine can drive the simulation",
            style="yellow",
        )
    server = viser.ViserServer(host=host, port=free, label=title, verbose=False)
    shown = HOST if host in ("0.0.0.0", "::") else host
    address = f"http://{f'[{shown}]' if ':' in shown else shown}:{server.get_port()}"
    notes.print(f"live page: {address}", soft_wrap=True)
    if show and _desktop():
        webbrowser.open(address)
    return server


def _free_port(host: str, port: int) -> int:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in range(port, min(port + _TRIED, 65536)):
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, candidate))
            except socket.gaierror:
                break
            except OSError as error:
                if error.errno in _IN_USE:
                    continue
                break
            return candidate
    else:
        raise ConfigError(f"--port: expected a free port from {port} on, found none up to {port + _TRIED - 1}")
    raise ConfigError(f"--host: expected an address of this machine, found {host!r}")


_IN_USE = {errno.EADDRINUSE, errno.EACCES}


def _local(host: str) -> bool:
    return host in ("localhost", "::1") or host.startswith("127.")


def _desktop() -> bool:
    if sys.platform != "linux":
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
