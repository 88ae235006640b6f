"""Serves a site until Ctrl-C, and says where it is."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from dextron_bench.cli.support.output import print_warning

if TYPE_CHECKING:
    from dextron_bench.web.local_server import LocalServer


def serve(server: LocalServer, path: str = "/") -> None:
    """Prints the address of a page, and over SSH how to forward its port; then serves until Ctrl-C."""
    print(f"{server.address.rstrip('/')}{path}", flush=True)
    if "SSH_CONNECTION" in os.environ:
        port = server.server_port
        print_warning(f"on your own machine: ssh -N -L {port}:127.0.0.1:{port} HOST, then open this address")
    server.serve_forever()
