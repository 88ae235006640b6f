"""Recordings: one episode in one .rrd file, exact enough to be verified, drawn so that a person sees it.

The only package that talks to Rerun.
"""

from dextron_bench.recording.archive import BrokenRecording, Recorded, Value, read, write
from dextron_bench.recording.pair import UnequalSettings, pair
from dextron_bench.recording.properties import ReaderError, Summary, read_safely, read_screened, screen, summarise
from dextron_bench.recording.stage import Stage, theatre
from dextron_bench.recording.storage import UnwritableRecording
from dextron_bench.recording.viewer import ViewerError, screenshots, view
from dextron_bench.recording.webviewer import web_viewer

__all__ = [
    "BrokenRecording",
    "ReaderError",
    "Recorded",
    "Stage",
    "Summary",
    "UnequalSettings",
    "UnwritableRecording",
    "Value",
    "ViewerError",
    "pair",
    "read",
    "read_safely",
    "read_screened",
    "screen",
    "screenshots",
    "summarise",
    "theatre",
    "view",
    "web_viewer",
    "write",
]
