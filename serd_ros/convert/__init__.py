"""Messages to plain values and back: pure functions, tested by round trip without spinning.

Field checks are off in these wheels, so an int in a float field is published as garbage: every
function here passes numbers through `float()` or `int()`.
"""
