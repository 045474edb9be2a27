"""A scenario: the place, its people, the robot and its task; its settings, rules and grid."""
