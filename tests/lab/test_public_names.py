"""The lab uses public entry points only: no name with a leading underscore of another module."""

import ast


def private_names(tree):
    """Imported and looked up names with one leading underscore, but those of an object itself."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            words = [*(node.module or "").split("."), *(each.name for each in node.names)]
        elif isinstance(node, ast.Import):
            words = [word for each in node.names for word in each.name.split(".")]
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) not in ("self", "cls"):
            words = [node.attr]
        else:
            continue
        yield from (word for word in words if word.startswith("_") and not word.endswith("__"))


def test_the_lab_uses_no_private_name_of_another_module(root):
    files = list((root / "lab").rglob("*.py"))
    assert len(files) > 50
    for file in files:
        assert not list(private_names(ast.parse(file.read_text()))), file
