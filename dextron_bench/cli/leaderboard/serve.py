"""`dextron-bench leaderboard serve`: the leaderboard's page, on this machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_warning
from dextron_bench.cli.support.serving import serve


@dataclass(frozen=True)
class Serve:
    """Serve the leaderboard's page on this machine only, with recordings in Rerun's web viewer. Ctrl-C stops it.

    Example: dextron-bench leaderboard serve --port 8000
    """

    port: int = 8765
    """The port on 127.0.0.1; 0 takes a free one."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard; its recordings are in the folder recordings next to it."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import server as leaderboard_server
        from dextron_bench.recording import ViewerError, web_viewer_files

        with leaderboard_server.Server(leaderboard_server.Site(self.board), self.port) as server:
            try:
                server.site.viewer.update(web_viewer_files())
            except ViewerError as error:
                print_warning(f"links download recordings, without a viewer: {error}")
            serve(server)
        return DONE
