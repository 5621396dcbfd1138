"""Pages with their plots as text."""

import base64
import gzip
import re

_PACKED = re.compile(r'(?<=<script type="application/gzip">).*?(?=</script>)')


def page_text(path):
    """The text of a page, in which each plot is the JSON that a browser unpacks."""
    text = path.read_text(encoding="utf-8")
    return _PACKED.sub(lambda match: gzip.decompress(base64.b64decode(match[0], validate=True)).decode(), text)
