"""What a page may request, as JSON objects with a `type`; all else is answered by an error."""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from serd_app.errors import TeleopError
from serd_files.yaml_config import StrictModel

LARGEST_REQUEST_BYTES = 4096
Mode = Literal["directions", "velocity"]
Direction = Literal["north", "east", "south", "west"]
_Share = Annotated[float, Field(ge=-1.0, le=1.0)]


class Hold(StrictModel):
    """Heartbeat of a page that drives by directions; direction: the one held now, if any."""

    type: Literal["hold"]
    direction: Direction | None


class Move(StrictModel):
    """Heartbeat of a page that drives by velocities, as shares of the greatest ones."""

    type: Literal["move"]
    linear: _Share
    angular: _Share


class Joystick(StrictModel):
    """State of a gamepad, up and left positive; also a heartbeat."""

    type: Literal["joy"]
    axes: Annotated[tuple[_Share, ...], Field(max_length=16)]
    buttons: Annotated[tuple[Annotated[int, Field(ge=0, le=1)], ...], Field(max_length=32)]


class Override(StrictModel):
    """The key that overrides the guard is held; repeated while it is."""

    type: Literal["override"]


class Away(StrictModel):
    """The page is no longer in front, or has gone."""

    type: Literal["away"]


class Episode(StrictModel):
    """Start, save or discard an episode."""

    type: Literal["episode"]
    do: Literal["start", "save", "discard"]


class EmergencyStop(StrictModel):
    """Engage the emergency stop, or release it."""

    type: Literal["e_stop"]
    engaged: bool


class SetMode(StrictModel):
    """Drive by directions or by velocities."""

    type: Literal["mode"]
    mode: Mode


PageRequest = Hold | Move | Joystick | Override | Away | Episode | EmergencyStop | SetMode
_REQUEST: TypeAdapter[PageRequest] = TypeAdapter(
    Annotated[PageRequest, Field(discriminator="type")]
)


def parse_request(text: str) -> PageRequest:
    """The request in a message of a page; TeleopError for anything else."""
    try:
        return _REQUEST.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "message"
        raise TeleopError(
            f"{place} of a page's request: {first['msg']}; load the page again"
        ) from None
