"""What commands and their options do, for the help of `serd-bag` and of `serd bag`."""

TEXTS = {
    "bags": "bag folder, or .mcap, .db3 or .bag file",
    "json": "print JSON instead of text",
    "output": "folder of the new bag, which must be empty or not exist",
    "rescue": "save every whole message of a broken recording, or of any bytes, in BAG_rescued",
    "verified_only": "leave out what a damaged part seems to hold, and no checksum vouches for",
    "info": "show what bags hold",
    "sizes": "read the bags for the bytes of each topic",
    "check": "read bags completely and list their faults",
    "require": "topic that must have messages: /whole/name, or name in any namespace; repeat",
    "convert": "write a sound bag as MCAP of ROS 2, BAG_mcap",
    "compression": "compression of the new bag",
}
