"""Recordings: one episode in one .rrd file, with exact arrays for verification and a layout for the viewer.

This is the only package that imports Rerun.
"""

from dextron_bench.recording.episode_file import BrokenRecording, Recording, Value, read, write
from dextron_bench.recording.live_view import LiveView, open_live_viewer
from dextron_bench.recording.pair import write_pair
from dextron_bench.recording.rrd_file import UnwritableRecording
from dextron_bench.recording.summaries import Summary, read_safely, read_screened, screen, summarise
from dextron_bench.recording.viewer import ViewerError, require_screen, screenshots, view
from dextron_bench.recording.web_viewer import web_viewer_files

__all__ = [
    "BrokenRecording",
    "LiveView",
    "Recording",
    "Summary",
    "UnwritableRecording",
    "Value",
    "ViewerError",
    "open_live_viewer",
    "read",
    "read_safely",
    "read_screened",
    "require_screen",
    "screen",
    "screenshots",
    "summarise",
    "view",
    "web_viewer_files",
    "write",
    "write_pair",
]
