"""A system without the module `fcntl`, such as Windows."""

import sys
from typing import Any

_modules: dict[str, Any] = sys.modules
_modules["fcntl"] = None
