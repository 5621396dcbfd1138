"""MkDocs hook: LaTeX equations become MathML, which browsers render without scripts."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Return a page's HTML with MathML in place of its equations."""
    return _EQUATION.sub(_mathml, content)


def _mathml(match: re.Match[str]) -> str:
    tag, opening, latex = match.groups()
    display = "block" if opening == "[" else "inline"
    return f"<{tag}>{convert(html.unescape(latex), display=display)}</{tag}>"
