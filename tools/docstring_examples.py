"""Examples of docstrings (`>>>`) as blocks of code; Markdown would take them for quotations."""

import re

from griffe import Extension, Object


class Examples(Extension):
    def on_object(self, *, obj: Object, **_: object) -> None:
        if obj.docstring:
            text, block = obj.docstring.value, r"(?ms)^>>> .*?(?=\n\n|\Z)"
            obj.docstring.value = re.sub(block, r"```pycon\n\g<0>\n```", text)
