"""A Meshcat server, or one line on why there is none."""

import logging
from typing import Any

from pydrake.geometry import Meshcat

from drake_tc.errors import ParamsError


def start_meshcat(*, quiet: bool = False) -> Any:
    """A Meshcat at the first free port from 7000 to 7999.

    Args:
        quiet: Do not tell its address: nobody needs to open it.

    Raises:
        ParamsError: none of the ports is free.
    """
    log = logging.getLogger("drake")
    level = log.level
    if quiet:
        log.setLevel(logging.WARNING)
    try:
        return Meshcat()
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ParamsError(
            f"Meshcat could not be started: {reason}; expected a free port from 7000 to 7999: end other programs that"
            " show robots"
        ) from None
    finally:
        log.setLevel(level)
