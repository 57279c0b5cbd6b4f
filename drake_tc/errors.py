"""The library's exceptions: one root, one subclass a border that input crosses."""


class DrakeTcError(Exception):
    """Root of every error that drake_tc raises on purpose.

    The message is one line that says what was expected, what came, and what is possible.

    Example:
        >>> try:
        ...     load_robot("nothing.yaml")
        ... except DrakeTcError as error:
        ...     print(type(error).__name__)
        ParamsError
    """


class LogError(DrakeTcError):
    """A log file that cannot be used: names the file, and the row and column where there is one."""


class RigError(DrakeTcError):
    """A rig file that cannot be used: names the file and the key."""


class ParamsError(DrakeTcError):
    """A parameter or model file that cannot be used: names the file, the joint and the field."""


class IdentificationError(DrakeTcError):
    """Data that cannot identify a model: names the parameter that suffers and the condition number."""


class SimulationError(DrakeTcError):
    """A simulation that cannot go on: names the system and the time."""
