"""3D view of a flight for a notebook or a file."""

import html
from pathlib import Path


class View:
    """Page with the 3D view of one or more flights, which works offline."""

    def __init__(self, page: str, height: int):
        """Create from the HTML text of the page and the height in a notebook [pixel]."""
        self.page, self._height = page, height

    def save(self, path: str | Path) -> Path:
        """Write the page and return its path. Raise ValueError if it cannot be written."""
        try:
            Path(path).write_text(self.page, encoding="utf-8")
        except OSError as fault:
            raise ValueError(f"{path}: cannot be written: {fault.strerror or fault}") from None
        return Path(path)

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self._height}px;border:0"
        return f'<iframe title="3D view" style="{style}" srcdoc="{html.escape(self.page, quote=True)}"></iframe>'
