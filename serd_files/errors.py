"""What a wrong input or file raises, in whichever of the distributions it is found."""

from serd_bag.errors import FileError
from serd_core.errors import SerdError

#: An error whose sentence a person reads: its cause is what was given, not a fault of the program.
USER_ERRORS = (SerdError, FileError)
