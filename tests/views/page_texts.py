"""Pages with their plots as text."""

import base64
import gzip
import re

_PACKED = re.compile(r'(?<=<script type="application/gzip">).*?(?=</script>)')


def page_text(path):
    """Return the text of a page, with the decompressed JSON of each plot."""
    text = path.read_text(encoding="utf-8")
    return _PACKED.sub(lambda match: gzip.decompress(base64.b64decode(match[0], validate=True)).decode(), text)
