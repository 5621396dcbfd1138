"""MkDocs hook: LaTeX equations become MathML, which browsers render without scripts."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

_DISPLAYED = re.compile(r"^\$\$(.*?)\$\$[ \t]*(?:\n\*\*\([^)]+\)\*\*$)?", re.DOTALL | re.MULTILINE)
_TAG = re.compile(r"\\tag\{([^}]*)\}")
_UNKNOWN = re.compile(r"\\|&(?!#?\w+;)")  # left in the text of an equation
_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page's Markdown with displayed equations as paragraphs of their own."""
    return _DISPLAYED.sub(lambda match: f"\n\n$$\n{match[1].strip()}\n$$\n\n", markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Return a page's HTML with MathML in place of its equations."""
    return _EQUATION.sub(_mathml, content)


def _mathml(match: re.Match[str]) -> str:
    tag, opening, latex = match.groups()
    latex = html.unescape(latex)
    number = _TAG.search(latex)
    equation = convert(_TAG.sub("", latex), display="block" if opening == "[" else "inline")
    if _UNKNOWN.search(re.sub(r"<[^>]*>", "", equation)):
        raise ValueError(f"the converter does not know a command of this equation: {latex}")
    if tag == "span":
        return f"<span>{equation}</span>"
    return f'<div class="equation"><div>{equation}</div>{f"<span>({number[1]})</span>" if number else ""}</div>'
