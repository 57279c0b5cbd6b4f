"""Reference of each input file: the page that `drake-tc schema KIND --page` prints."""

from drake_tc.cli.schema_command import Document, document_page


def pages() -> dict[str, str]:
    """Page to its text."""
    return {f"reference/{document.value}.md": document_page(document) for document in Document}
