"""The commands info, check, recover and convert, for `serd bag` and for `serd-bag` without ROS."""
