"""The programs that this package starts: Python itself, and tools of the system.

Neither takes anything from the working folder, which may hold files of a stranger: a `random.py` there must not run in
the place of the library, nor a `git` there in the place of git.
"""

from __future__ import annotations

import os
import shutil
import sys

PYTHON = (sys.executable, "-P")  # -P: the working folder is not on the search path for modules.


def python(*words: str) -> list[str]:
    """The command of a Python process; `words` are `-m` with a module, or `-c` with code, and their arguments."""
    return [*PYTHON, *words]


def keep_to_installed_code() -> None:
    """Lets libraries, too, start Python processes without the working folder; GLFW's and Ray's start some."""
    os.environ["PYTHONSAFEPATH"] = "1"


def find(name: str) -> str | None:
    """The absolute path of a program of the system, from PATH without its relative folders; None if there is none."""
    folders = [folder for folder in os.get_exec_path() if os.path.isabs(folder)]
    file = shutil.which(name, path=os.pathsep.join(folders))
    return file if file and os.path.isabs(file) else None  # On Windows, `which` also looks in the working folder.
