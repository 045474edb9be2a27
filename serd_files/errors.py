"""What a wrong input or file raises, and what to install where a library is missing."""

from serd_bag.errors import FileError
from serd_core.errors import SerdError

#: An error whose sentence a person reads: its cause is what was given, not a fault of the program.
USER_ERRORS = (SerdError, FileError)
#: The extra of `serd` that installs a library.
_EXTRA_OF = {"matplotlib": "sim", "pybullet": "sim", "pybullet_utils": "sim"}


def missing_pictures() -> str:
    """Why no picture is drawn, as Matplotlib is not installed; empty where it is."""
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        return f"no picture is drawn: {missing_extra(error)}"
    return ""


def missing_extra(error: ModuleNotFoundError) -> str:
    """The sentence for a library that an extra installs; empty for any other module."""
    library = (error.name or "").partition(".")[0]
    extra = _EXTRA_OF.get(library)
    if extra is None:
        return ""
    return f"{library} is not installed; run: pip install 'serd[{extra}]'"
