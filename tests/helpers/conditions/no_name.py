"""A user without a name and a home, as in a container that runs with `-u 12345`."""

import os
import pwd

for _name in ("HOME", "USER", "LOGNAME", "LNAME", "USERNAME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"):
    os.environ.pop(_name, None)


def _getpwuid(number: int) -> pwd.struct_passwd:
    raise KeyError(f"getpwuid(): uid not found: {number}")


pwd.getpwuid = _getpwuid
