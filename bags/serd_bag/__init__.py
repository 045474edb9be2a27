"""Reading, writing, checking and repairing rosbag2 recordings. No ROS is needed.

Import from its modules: `reader` has BagReader, `writer` BagWriter, `recorder` BagRecorder,
`rescue.saving` rescue, `health.check` check_bag, `health.contents`
contents_of_bag, `command.rewrite` convert, `verbs` cut, difference and reindex. What is wrong with
a bag or an argument raises `errors.BagError`, whose text is one sentence with the fix.
"""
