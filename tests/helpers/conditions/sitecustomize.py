"""Python imports this module at its start; it imports the conditions that the variable CONDITIONS names."""

import importlib
import os

for _name in filter(None, os.environ.get("CONDITIONS", "").split(",")):
    importlib.import_module(_name)
