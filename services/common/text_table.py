"""Table of texts, which compiled blocks refer to by index."""

from collections.abc import Iterable
from typing import Any


class TextTable:
    """Growing table of texts with an index."""

    def __init__(self, texts: Iterable[Any] = ()):
        """Create a table that starts with `texts`."""
        self.table = list(texts)
        self._number = {text: i for i, text in enumerate(self.table)}

    def number(self, text: Any) -> int:
        """Return the index of a text; append it if it is new."""
        if text not in self._number:
            self._number[text] = len(self.table)
            self.table.append(text)
        return self._number[text]
