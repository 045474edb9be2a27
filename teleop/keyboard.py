"""What the keys of a terminal mean while somebody drives."""

from enum import Enum

from serd_core.grid.grid import Action


class KeyCommand(Enum):
    """What a key can ask for besides driving."""

    START = "start an episode"
    SAVE = "save the episode"
    DISCARD = "discard the episode"
    E_STOP = "E-STOP engaged"
    RELEASE = "e-stop released"
    SWITCH_MODE = "switch between directions and velocities"


KEY_COMMANDS = {
    "enter": KeyCommand.START,
    "s": KeyCommand.SAVE,
    "d": KeyCommand.DISCARD,
    "space": KeyCommand.E_STOP,
    "r": KeyCommand.RELEASE,
    "tab": KeyCommand.SWITCH_MODE,
}

KEY_DIRECTIONS = {
    "up": Action.NORTH,
    "right": Action.EAST,
    "down": Action.SOUTH,
    "left": Action.WEST,
    "w": Action.WAIT,
}

HELP = """\
  arrow keys   next move: up is north; w takes it back
  u i o  j k l  m , .   drive by velocities (Tab switches), q/z w/x e/c change the speeds
  Enter start   s save   d discard   SPACE e-stop   r release   Ctrl-C end"""
