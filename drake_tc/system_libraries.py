"""Shared libraries of the system that Drake and the optional solvers load, and the packages that have them.

A wheel brings most of its libraries, but not all: on a bare machine `import pydrake` ends with an ImportError that
names a file such as `libglib-2.0.so.0`. This module turns that into the name of a package, and needs Python alone.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO

PACKAGES: Mapping[str, str] = {
    "libglib-2.0": "libglib2.0-0",
    "libgthread-2.0": "libglib2.0-0",
    "libgomp": "libgomp1",
    "libX11": "libx11-6",
    "libXext": "libxext6",
    "libXrender": "libxrender1",
    "libSM": "libsm6",
    "libICE": "libice6",
    "libGL": "libgl1",
    "libEGL": "libegl1",
    "libOpenGL": "libopengl0",
    "libGLU": "libglu1-mesa",
}
"""Debian's and Ubuntu's package of each library. `libglib2.0-0` is also a name of what Debian 13 and Ubuntu 24.04 call
`libglib2.0-0t64`."""


def missing_library(error: BaseException) -> str | None:
    """The file name of the shared library whose absence `error` reports; None if it reports something else."""
    found = re.search(r"(lib[\w.+-]+?\.(?:so(?:\.\d+)*|dylib)): cannot open shared object file", str(error))
    return found[1] if found else None


def package_of(library: str) -> str | None:
    """Debian's package of a library such as `libglib-2.0.so.0`; None if it is not one of `PACKAGES`."""
    return PACKAGES.get(library.split(".so")[0])


def how_to_install(library: str) -> str:
    """What to do about a missing library, as the rest of a sentence."""
    package = package_of(library)
    if package is None:
        return f"the system library {library} is missing; install the package of your system that has it"
    return f"the system library {library} is missing; on Debian and Ubuntu: apt install {package}"


def import_error(module: str) -> ImportError | None:
    """Import a module and return what stopped it; None if nothing did.

    What the module prints on the way is dropped: pydrake prints a page of advice before it raises.
    """
    try:
        with redirect_stdout(StringIO()):
            import_module(module)
    except ImportError as error:
        return error
    return None


def missing_packages(modules: Sequence[str]) -> list[str]:
    """Packages that have what the modules lack when they are imported; the library itself where none is known."""
    errors = [error for module in modules if (error := import_error(module)) is not None]
    libraries = [library for error in errors if (library := missing_library(error)) is not None]
    return list(dict.fromkeys(package_of(library) or library for library in libraries))
