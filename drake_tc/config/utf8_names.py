"""Names of files in texts that are written in UTF-8, whatever bytes a name has."""

from pathlib import Path


def utf8_text(text: str) -> str:
    """The text; surrogates, as Python has them for bytes of a name that are not UTF-8, are replaced by U+FFFD."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def utf8_name(path: Path | str) -> str:
    """The name of a file without its folder, as `utf8_text`."""
    return utf8_text(Path(path).name)
