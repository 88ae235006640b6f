"""`dextron-bench browse`: the episodes of many runs on one page, searched by expressions and opened from there."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import print_json
from dextron_bench.cli.support.serving import serve

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.catalogue.browse.search import Search

PATIENCE = 2.0  # [s] in which a viewer that cannot start has ended.


@dataclass(frozen=True)
class Browse:
    """Serve a page with the episodes of all runs, on this machine only. Ctrl-C stops it.

    The page filters by expressions, such as cause == 'too late' and return < 5, and shows a card with a picture for
    each episode. Its button opens the recording in Rerun's native viewer, or with --web in the browser, and makes the
    recording first if there is none. On another machine, forward the port: ssh -L 8766:127.0.0.1:8766 HOST.

    Example: dextron-bench browse --web

    Example: dextron-bench browse runs/rlil-0.1 --where "cause == 'too late' and subject == '04' and return < 5"

    Example: dextron-bench browse --web --where "not success and split == 'val'" --order "worst first"

    Example: dextron-bench browse --where "not success and split == 'hard'" --json
    """

    place: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN|DIR ...")] = (Path("runs"),)
    """Folders of runs."""
    where: str = ""
    """The expression that the page starts with; docs/recordings.md lists the columns."""
    order: str = "as played"
    """The order that the page starts with, such as "worst first"."""
    web: bool = False
    """Open recordings in the browser; no screen and no GPU is needed here."""
    port: int = 8766
    """The port on 127.0.0.1; 0 takes a free one."""
    json: bool = False
    """Print the matching episodes as JSON and serve nothing."""

    def __call__(self) -> int:
        from dextron_bench.catalogue import episodes as catalogue
        from dextron_bench.catalogue.browse.search import Search

        if not self.json and not self.web:
            from dextron_bench.recording import require_screen

            require_screen()
        search = Search(self.where, self.order)
        episodes = catalogue.read(self.place)
        matching = search.matching(episodes)  # Raises BadExpression before anything is served.
        if self.json:
            rows = matching[list(catalogue.COLUMNS)].to_dict("records")
            print_json(rows)
        else:
            self._serve(episodes, search)
        return DONE

    def _serve(self, episodes: pd.DataFrame, search: Search) -> None:
        from dextron_bench.catalogue.browse.site import BrowseSite
        from dextron_bench.recording import web_viewer_files
        from dextron_bench.web.local_server import LocalServer

        site = BrowseSite(episodes, viewer=web_viewer_files()) if self.web else BrowseSite(episodes, _show)
        with closing(site), LocalServer(site, self.port) as server:
            serve(server, search.address)


def _show(file: Path) -> None:
    """Opens the native viewer, in a window of its own; raises ViewerError if it ends at once."""
    from dextron_bench import recording

    errors: list[recording.ViewerError] = []

    def view() -> None:
        try:
            recording.view([file])
        except recording.ViewerError as error:
            errors.append(error)

    thread = Thread(target=view, daemon=True)
    thread.start()
    thread.join(PATIENCE)
    if errors:
        raise errors[0]
