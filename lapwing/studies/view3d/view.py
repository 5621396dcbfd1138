"""The 3D view of a flight as a value: shown by a notebook, or saved as a page."""

import html
from pathlib import Path


class View:
    """A page with the 3D view of one or more flights, which needs no network."""

    def __init__(self, page: str, height: int):
        """Create from the text of the page and the height of a notebook cell [pixel]."""
        self.page, self._height = page, height

    def save(self, path: str | Path) -> Path:
        """Write the page; return its path. Raises ValueError if it cannot be written."""
        try:
            Path(path).write_text(self.page, encoding="utf-8")
        except OSError as fault:
            raise ValueError(f"{path}: cannot be written: {fault.strerror or fault}") from None
        return Path(path)

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self._height}px;border:0"
        return f'<iframe title="3D view" style="{style}" srcdoc="{html.escape(self.page, quote=True)}"></iframe>'
