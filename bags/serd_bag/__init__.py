"""Reading, writing, checking and repairing rosbag2 recordings. No ROS is needed.

Import from its modules: `reader` has BagReader, `writer` BagWriter, `recorder` BagRecorder,
`playback` Playback, `health.check` check_bag and contents_of_bag, `command.rewrite` recover and
convert. What is wrong with a bag or an argument raises `errors.BagError`, whose text is one
sentence with the fix.
"""
