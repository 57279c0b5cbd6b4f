"""`--seed` of the commands that draw no random numbers: scripts can hand the same options to every command."""

from typing import Annotated

import typer

UnusedSeed = Annotated[int, typer.Option("--seed", help="Accepted by every command; this one does not use it.")]
